// Saves a figure of the page as it is printed: its colours fall back to those of paper.
{
  const inPrint = (svg) => new XMLSerializer().serializeToString(svg)
    .replace(/var\(--[\w-]+, (#[0-9a-f]{6})\)/g, "$1");

  function download(blob, name) {
    const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob),
      download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }

  const DOTS_PER_POINT = 300 / 72;

  async function png(svg, text) {
    const image = new Image();
    // A report of the live page may show an image of `data:` and no other.
    image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`;
    await image.decode();
    const { width, height } = svg.viewBox.baseVal;
    const canvas = Object.assign(document.createElement("canvas"), {
      width: Math.round(width * DOTS_PER_POINT), height: Math.round(height * DOTS_PER_POINT) });
    canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
    return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
  }

  for (const button of document.querySelectorAll("figcaption .save button")) {
    button.addEventListener("click", async () => {
      const svg = button.closest("figure").querySelector("svg");
      const text = inPrint(svg);
      const file = button.value === "svg" ? new Blob([text], { type: "image/svg+xml" }) : await png(svg, text);
      download(file, `${button.parentElement.dataset.name}.${button.value}`);
    });
  }
}
