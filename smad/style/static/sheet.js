// A figure for paper: panels over one axis, or a plane, as SVG, PDF and PNG. A sheet is a list of
// lines and texts in points; each format writes that list. Colours are those of print.

import { css, decimals, element, shown } from "./plots.js";
import { PRINT_FONT } from "./vendor/font.js";

const MM = 72 / 25.4;
export const WIDTHS_MM = { "one column": 85, "two columns": 175 };
const PANEL_PT = 90;
const ROOM = { left: 40, right: 8, top: 16, bottom: 14, label: 14 };
const KEY = { row: 10, sample: 12, gap: 3, between: 8 };
const SIZE_PT = 8;
const LINE_PT = 0.9;
const TICKS = 5;
const PNG_DPI = 600;

// What `make` returns with the colours of a light ground, whatever the screen has.
function inPrint(make) {
  const root = document.documentElement;
  const was = root.classList.contains("paper");
  root.classList.add("paper");
  try {
    return make();
  } finally {
    root.classList.toggle("paper", was);
  }
}

const penOf = (name) => css(`--${name}`);

// Round values within a range, at steps of 1, 2 or 5, and how they are written.
export function ticks(low, high, most = TICKS) {
  const rough = (high - low) / most;
  if (!(rough > 0)) return [[low, String(low)]];
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((times) => times * power).find((candidate) => candidate >= rough);
  const digits = decimals(step);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) found.push([k * step, shown(k * step, digits)]);
  return found;
}

// On paper the springs differ without colours, too.
const dashOf = ({ pen, dash = [] }) => (pen === "y" && !dash.length ? [3, 1.5] : dash);

// The part of a line between two points that lies in a box; null where none does.
function inside([x0, y0], [x1, y1], { left, right, up, down }) {
  let [from, to] = [0, 1];
  for (const [along, room] of [[x0 - x1, x0 - left], [x1 - x0, right - x0], [y0 - y1, y0 - up], [y1 - y0, down - y0]]) {
    if (along === 0 && room < 0) return null;
    if (along < 0) from = Math.max(from, room / along);
    if (along > 0) to = Math.min(to, room / along);
  }
  const at = (share) => [x0 + share * (x1 - x0), y0 + share * (y1 - y0)];
  return from > to ? null : [from > 0 ? at(from) : [x0, y0], to < 1 ? at(to) : [x1, y1]];
}

// The polylines of points within a box; null breaks a line.
function partsInside(points, box) {
  const parts = [];
  let [last, open] = [null, null];
  for (const point of points) {
    const part = last && point && inside(last, point, box);
    if (part && part[0].join() === open) parts[parts.length - 1].push(part[1]);
    else if (part) parts.push(part);
    open = part ? part[1].join() : null;
    last = point;
  }
  return parts;
}

// The key of lines, in rows that are `room` wide: of each its place from the left, its row, its sample's width.
function keyOf(lines, room) {
  let [x, row] = [0, 0];
  return lines.filter(({ label }) => label).map((line) => {
    // What has a colour of its own is one of many, such as a cycle: its name has that colour.
    const sample = line.colour ? 0 : KEY.sample + KEY.gap;
    const width = sample + widthOf(line.label);
    if (x && x + width > room) [x, row] = [0, row + 1];
    const place = { line, x, row, sample, end: x + width };
    x += width + KEY.between;
    return place;
  });
}

// `boxes`: [{title, unit, x: [low, high], y: [low, high], lines: [{x, y, pen, dash, label}]}] of one
// axis `xLabel`. Returns {width, height, items} in points.
export function sheetOf(boxes, xLabel, widthMm, heightPt = PANEL_PT) {
  const width = widthMm * MM;
  const items = [];
  const text = (x, y, words, align = "left", colour = penOf("text")) => items.push({ kind: "text", x, y, words, align, colour });
  const path = (points, colour, thick = 0.5, dash = []) => items.push({ kind: "line", points, colour, thick, dash });
  let top = 0;
  boxes.forEach((box, n) => {
    const [left, right] = [ROOM.left, width - ROOM.right];
    const title = `${box.title}${box.unit ? ` (${box.unit})` : ""}`;
    // Beside the title where it fits in one row, or else below it.
    const beside = keyOf(box.lines, Infinity);
    const keyWidth = Math.max(0, ...beside.map(({ end }) => end));
    const fits = widthOf(title) + KEY.between + keyWidth <= right - left;
    const key = fits ? beside : keyOf(box.lines, right - left);
    const rows = fits ? 0 : Math.max(...key.map(({ row }) => row)) + 1;
    const [up, down] = [top + ROOM.top + KEY.row * rows, top + ROOM.top + KEY.row * rows + heightPt];
    const px = (value) => left + ((value - box.x[0]) / (box.x[1] - box.x[0] || 1)) * (right - left);
    const py = (value) => down - ((value - box.y[0]) / (box.y[1] - box.y[0] || 1)) * (down - up);
    const grid = penOf("line");
    for (const [value, words] of ticks(...box.y)) {
      path([[left, py(value)], [right, py(value)]], grid, 0.4);
      text(left - 3, py(value) + SIZE_PT / 3, words, "right");
    }
    const lowest = n === boxes.length - 1;
    for (const [value, words] of ticks(...box.x, box.ticks ?? 7)) {
      path([[px(value), down], [px(value), up]], grid, 0.4);
      if (lowest) text(px(value), down + SIZE_PT + 2, words, "centre");
    }
    path([[left, up], [left, down], [right, down]], penOf("text"), 0.6);
    text(left, up - 5 - KEY.row * rows, title);
    for (const { line, x, row, sample } of key) {
      const [from, level] = [fits ? right - keyWidth + x : left + x, up - 5 - KEY.row * Math.max(0, rows - 1 - row)];
      if (sample) path([[from, level - 3], [from + KEY.sample, level - 3]], penOf(line.pen), LINE_PT, dashOf(line));
      text(from + sample, level, line.label, "left", line.colour);
    }
    for (const line of box.lines) {
      const points = [];
      line.y.forEach((y, i) => {
        // Of another run's sample there is no value here, and no break.
        if (y !== undefined) points.push(y === null || line.x[i] == null ? null : [px(line.x[i]), py(y)]);
      });
      for (const part of partsInside(points, { left, right, up, down })) path(part, line.colour ?? penOf(line.pen), LINE_PT, dashOf(line));
    }
    top = down + (lowest ? 0 : 4);
  });
  const height = top + ROOM.bottom + ROOM.label;
  text((ROOM.left + width - ROOM.right) / 2, height - 4, xLabel, "centre");
  return { width, height, items };
}

const round = (value) => Math.round(value * 100) / 100;
const escaped = (words) => words.replace(/[&<>"]/g, (sign) => `&#${sign.charCodeAt(0)};`);

export function svgOf({ width, height, items }) {
  const anchors = { left: "start", right: "end", centre: "middle" };
  const drawn = items.map((item) => (item.kind === "text"
    ? `<text x="${round(item.x)}" y="${round(item.y)}" text-anchor="${anchors[item.align]}" fill="${item.colour}">${escaped(item.words)}</text>`
    : `<polyline points="${item.points.map((p) => p.map(round).join()).join(" ")}" fill="none" stroke="${item.colour}" stroke-width="${item.thick}" stroke-linejoin="round"${item.dash.length ? ` stroke-dasharray="${item.dash.join()}"` : ""}/>`));
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${round(width)}pt" height="${round(height)}pt" viewBox="0 0 ${round(width)} ${round(height)}" font-family="Helvetica, Arial, sans-serif" font-size="${SIZE_PT}">\n<rect width="100%" height="100%" fill="#ffffff"/>\n${drawn.join("\n")}\n</svg>\n`;
}

const glyphOf = (letter) => PRINT_FONT.glyphs[letter] ?? PRINT_FONT.glyphs["?"];
const widthOf = (words) => Array.from(words, (letter) => glyphOf(letter)[1]).reduce((a, b) => a + b, 0) * SIZE_PT / 1000;
const hex = (number) => number.toString(16).padStart(4, "0");
const glyphsOf = (words) => `<${Array.from(words, (letter) => hex(glyphOf(letter)[0])).join("")}>`;

// The objects of a PDF, from number `first` on, that embed the font: publishers refuse a file
// without. Its text is glyph numbers, and the last object says which letters these are.
function fontObjects(first) {
  const glyphs = Object.entries(PRINT_FONT.glyphs);
  const stream = (data, more = "") => `<< /Length ${data.length}${more} >>\nstream\n${data}\nendstream`;
  const file = atob(PRINT_FONT.file);
  const name = `/SMADAA+${PRINT_FONT.name}`;
  const letters = [];
  for (let k = 0; k < glyphs.length; k += 100) {
    const part = glyphs.slice(k, k + 100).map(([letter, [number]]) => `<${hex(number)}> <${hex(letter.charCodeAt(0))}>`);
    letters.push(`${part.length} beginbfchar\n${part.join("\n")}\nendbfchar`);
  }
  return [
    `<< /Type /Font /Subtype /Type0 /BaseFont ${name} /Encoding /Identity-H /DescendantFonts [${first + 1} 0 R] /ToUnicode ${first + 4} 0 R >>`,
    `<< /Type /Font /Subtype /CIDFontType2 /BaseFont ${name} /CIDSystemInfo << /Registry (Adobe) /Ordering (Identity) /Supplement 0 >> /CIDToGIDMap /Identity /FontDescriptor ${first + 2} 0 R /W [${glyphs.map(([, [number, width]]) => `${number} [${width}]`).join(" ")}] >>`,
    `<< /Type /FontDescriptor /FontName ${name} /Flags 32 /FontBBox [${PRINT_FONT.box.join(" ")}] /ItalicAngle 0 /Ascent ${PRINT_FONT.ascent} /Descent ${PRINT_FONT.descent} /CapHeight ${PRINT_FONT.ascent} /StemV 80 /FontFile2 ${first + 3} 0 R >>`,
    stream(file, ` /Length1 ${file.length}`),
    stream(`/CIDInit /ProcSet findresource begin 12 dict begin begincmap /CMapName /Letters def /CMapType 2 def\n1 begincodespacerange <0000> <ffff> endcodespacerange\n${letters.join("\n")}\nendcmap CMapName currentdict /CMap defineresource pop end end`),
  ];
}

// The bytes of a PDF of one page.
export function pdfOf({ width, height, items }) {
  const rgb = (colour) => [1, 3, 5].map((at) => round(parseInt(colour.slice(at, at + 2), 16) / 255)).join(" ");
  const ops = items.map((item) => {
    if (item.kind === "text") {
      const back = { left: 0, right: widthOf(item.words), centre: widthOf(item.words) / 2 }[item.align];
      return `BT ${rgb(item.colour)} rg /F1 ${SIZE_PT} Tf ${round(item.x - back)} ${round(height - item.y)} Td ${glyphsOf(item.words)} Tj ET`;
    }
    const points = item.points.map(([x, y], i) => `${round(x)} ${round(height - y)} ${i ? "l" : "m"}`).join(" ");
    return `${rgb(item.colour)} RG ${item.thick} w [${item.dash.join(" ")}] 0 d ${points} S`;
  });
  const content = ["1 J 1 j", ...ops].join("\n");
  const objects = [
    "<< /Type /Catalog /Pages 2 0 R >>",
    "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
    `<< /Type /Page /Parent 2 0 R /MediaBox [0 0 ${round(width)} ${round(height)}] /Contents 4 0 R /Resources << /Font << /F1 5 0 R >> >> >>`,
    `<< /Length ${content.length} >>\nstream\n${content}\nendstream`,
    ...fontObjects(5),
  ];
  let file = "%PDF-1.4\n";
  const places = objects.map((object, i) => {
    const at = file.length;
    file += `${i + 1} 0 obj\n${object}\nendobj\n`;
    return at;
  });
  const start = file.length;
  file += `xref\n0 ${objects.length + 1}\n0000000000 65535 f \n${places.map((at) => `${String(at).padStart(10, "0")} 00000 n \n`).join("")}`;
  file += `trailer\n<< /Size ${objects.length + 1} /Root 1 0 R >>\nstartxref\n${start}\n%%EOF\n`;
  return Uint8Array.from(file, (byte) => byte.charCodeAt(0));
}

// The chunk of a PNG that says how many pixels an inch has.
function resolutionOf(dpi) {
  const chunk = new DataView(new ArrayBuffer(21));
  chunk.setUint32(0, 9);
  Array.from("pHYs", (letter, i) => chunk.setUint8(4 + i, letter.charCodeAt(0)));
  for (const place of [8, 12]) chunk.setUint32(place, Math.round(dpi / 0.0254));
  chunk.setUint8(16, 1);
  let crc = ~0;
  for (const byte of new Uint8Array(chunk.buffer, 4, 13)) {
    crc ^= byte;
    for (let bit = 0; bit < 8; bit += 1) crc = crc & 1 ? (crc >>> 1) ^ 0xedb88320 : crc >>> 1;
  }
  chunk.setUint32(17, ~crc >>> 0);
  return chunk.buffer;
}

// Bytes of signature and IHDR, behind which other chunks may stand.
const PNG_HEAD = 33;

// A PNG of an SVG text, as a promise of a blob.
export function pngOf(svg, width, height) {
  const scale = PNG_DPI / 72;
  return new Promise((done, failed) => {
    const image = new Image();
    image.onload = () => {
      const canvas = element("canvas", { width: Math.round(width * scale), height: Math.round(height * scale) });
      canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
      canvas.toBlob((blob) => done(new Blob([blob.slice(0, PNG_HEAD), resolutionOf(PNG_DPI), blob.slice(PNG_HEAD)], { type: blob.type })), "image/png");
    };
    image.onerror = failed;
    image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`;
  });
}

export function save(blob, name) {
  const link = element("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

// Buttons that save what `make(widthMm)` returns as a sheet, at the width that is chosen.
export function saveButtons(make, name) {
  const width = element("select", { ariaLabel: "Width of the saved figure" },
    ...Object.entries(WIDTHS_MM).map(([label, mm]) => element("option", { value: mm, textContent: `${label}, ${mm} mm` })));
  const button = (kind, blobOf) => {
    const saver = element("button", { type: "button", textContent: kind, title: `Save this figure as ${kind}` });
    saver.dataset.save = kind.toLowerCase();
    saver.onclick = async () => save(await blobOf(inPrint(() => make(Number(width.value)))), `${name().replace(/[^\w.]+/g, "-")}.${kind.toLowerCase()}`);
    return saver;
  };
  return element("span", { className: "save" }, "Save ",
    button("SVG", (sheet) => new Blob([svgOf(sheet)], { type: "image/svg+xml" })),
    button("PDF", (sheet) => new Blob([pdfOf(sheet)], { type: "application/pdf" })),
    button("PNG", (sheet) => pngOf(svgOf(sheet), sheet.width, sheet.height)), width);
}

// The least and the greatest of what lies within a range of x, with some room.
export function spanOf(lines, [from, to]) {
  let [low, high] = [Infinity, -Infinity];
  for (const { x, y } of lines) {
    y.forEach((value, i) => {
      if (value == null || x[i] < from || x[i] > to) return;
      low = Math.min(low, value);
      high = Math.max(high, value);
    });
  }
  if (low > high) return [0, 1];
  const margin = 0.06 * (high - low || Math.abs(high) || 1);
  return [low - margin, high + margin];
}
