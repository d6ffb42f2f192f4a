// Inputs made from the server's description of the types; nothing here knows a trajectory by name.

import { element } from "./style/plots.js";

// Fill `host` with the inputs of a form; returns a function that reads them.
export function build(host, form) {
  const inputs = form.fields.map((field) => {
    const input = inputOf(field);
    host.append(labelled(field, input));
    return [field, input];
  });
  return () => Object.fromEntries(inputs.map(([field, input]) => [field.name, valueOf(field, input)]));
}

// As `build`, but each field is told on its own as soon as it was changed. Returns a function that
// shows what is in force; a field that somebody is changing is left to them.
export function buildLive(host, form, changed) {
  const rows = [];
  const changing = new Map(); // field: whether it was sent, until the answer comes
  for (const field of form.fields) {
    const input = inputOf(field);
    const row = labelled(field, input);
    const tell = async () => {
      if (!input.reportValidity()) return;
      changing.set(field, true);
      await changed(field, valueOf(field, input));
      changing.delete(field);
    };
    row.addEventListener("input", () => changing.set(field, false));
    row.addEventListener("focusout", () => {
      // Typed back to what it was, there is no change to send.
      if (!changing.get(field)) changing.delete(field);
    });
    input.addEventListener("change", tell);
    if (field.slider != null) row.append(sliderOf(field, input, tell));
    host.append(row);
    rows.push([field, input]);
  }
  return (inForce) => {
    for (const [field, input] of rows) {
      const value = inForce[field.name];
      if (value == null || changing.has(field)) continue;
      if (field.kind === "switch") input.checked = value;
      else if (String(valueOf(field, input)) !== String(value)) {
        input.value = value;
        input.dispatchEvent(new Event("input"));
        changing.delete(field);
      }
    }
  };
}

function labelled(field, input) {
  const label = element("label", { className: "field", title: field.about }, field.label, input);
  label.append(element("span", { className: "unit", textContent: field.unit }));
  return label;
}

function inputOf(field) {
  const name = { name: field.name };
  if (field.kind === "switch") {
    return element("input", { ...name, type: "checkbox", checked: Boolean(field.initial) });
  }
  if (field.kind === "choice") {
    const select = element("select", name, ...field.choices.map((text) => element("option", { textContent: text })));
    if (field.initial != null) select.value = field.initial;
    return select;
  }
  const input = element("input", { ...name, type: "number", required: true,
    step: field.kind === "whole" ? "1" : "any", value: field.initial ?? "" });
  if (field.least != null) input.min = field.least;
  if (field.most != null) input.max = field.most;
  if (field.above) {
    const check = () => input.setCustomValidity(
      Number(input.value) > field.least ? "" : `has to be above ${field.least}`);
    input.addEventListener("input", check);
    check();
  }
  return input;
}

function sliderOf(field, input, tell) {
  const slider = element("input", { type: "range", min: field.least ?? 0, max: field.slider,
    step: field.slider / 200, value: field.initial, ariaLabel: field.label });
  slider.addEventListener("input", () => { input.value = slider.value; });
  slider.addEventListener("change", tell);
  input.addEventListener("input", () => { slider.value = input.value; });
  return slider;
}

function valueOf(field, input) {
  if (field.kind === "switch") return input.checked;
  return field.kind === "choice" ? input.value : Number(input.value);
}
