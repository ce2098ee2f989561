// Drawing with SVG; every mark has a pattern or a label beside its colour
const INK = "#22222a", SOFT = "#6d6a66", RULE = "#e0dcd3", FAINT = "#f3f0e9", RED = "#c2410c";
const HUES = ["#0072b2", "#e69f00", "#009e73", "#a8558a", "#56b4e9", "#8a6d3b"];
const TONE = {drive: "#4a4a55", wait: "#b9b3a6", overrun: RED, job: "#009e73", energy: "#e69f00"};
const SVG = "http://www.w3.org/2000/svg";
function make(tag, attributes = {}, ...children) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  for (const child of children) node.append(child);
  return node;
}
const text = (x, y, content, more = {}) => make("text", {x, y, ...more}, String(content));
function elided(name, room) {  // in so many pixels, without its middle: settings of a knob end it
  const most = Math.max(3, Math.floor(room / 6.8)), end = most >> 1;
  return name.length <= most ? name : `${name.slice(0, most - end - 1)}…${name.slice(-end)}`;
}
function named(x, y, name, room, more = {class: "strong"}) {
  const shown = text(x, y, elided(name, room), more);
  if (shown.textContent !== name) shown.append(make("title", {}, name));
  return shown;
}
function picture(id, height, title) {
  const home = $(id), width = Math.max(240, home.clientWidth);
  const svg = make("svg", {viewBox: `0 0 ${width} ${height}`, height, role: "img", "aria-label": title});
  svg.append(make("title", {}, title));
  home.replaceChildren(svg);
  return [svg, width];
}
const HATCHES = [
  null, "M0 6L6 0M-1 1L1 -1M5 7L7 5", "M0 3H6", "M3 0V6", "M0 0L6 6M-1 5L1 7M5 -1L7 1", "M0 3H6M3 0V6",
];
function fills(svg, names) {  // name -> fill: the hue, with lines over it that tell it apart in grey
  const shades = {}, defs = make("defs");
  names.forEach((name, index) => {
    const hue = TONE[name] || HUES[run().labels.indexOf(name) % HUES.length] || HUES[0];
    const marks = {drive: 0, wait: 1, overrun: 4, job: 2, energy: 2}[name] ?? [0, 1, 3, 2, 5][index % 5];
    if (!HATCHES[marks]) { shades[name] = hue; return; }
    const id = `${svg.parentNode.id}-${index}`;
    defs.append(make("pattern", {id, width: 6, height: 6, patternUnits: "userSpaceOnUse"},
      make("rect", {width: 6, height: 6, fill: hue, opacity: name === "wait" ? .55 : .75}),
      make("path", {d: HATCHES[marks], stroke: name === "wait" ? "#6d6a66" : "#fff", "stroke-width": 1.3, fill: "none"})));
    shades[name] = `url(#${id})`;
  });
  svg.append(defs);
  return shades;
}
function number(value) {
  if (value === null || value === undefined) return "—";
  const shown = Math.abs(value) < 10 ? value.toFixed(2) : value.toFixed(1);
  return Math.abs(value) < 1 && !/^-?0\.00$/.test(shown) ? shown.replace("0.", ".").replace("-", "−") : shown.replace("-", "−");
}
function duration(seconds) {
  if (seconds === 0) return "0";
  return Math.abs(seconds) < 1 ? `${Math.round(1e3 * seconds)} ms` : `${seconds.toFixed(seconds < 10 ? 2 : 1)} s`;
}
function ticks(low, high, count) {
  const raw = (high - low) / count || 1, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map(n => n * power).find(n => n >= raw) || raw;
  const marks = [];
  for (let mark = Math.ceil(low / step - 1e-9) * step; mark <= high + 1e-9 * step; mark += step) marks.push(Math.abs(mark) < step / 1e6 ? 0 : mark);
  return [marks, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))];
}
function pressable(node, label, act) {
  node.classList.add("hit");
  node.append(make("title", {}, label));
  node.addEventListener("click", act);
  return node;
}
