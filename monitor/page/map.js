// The map: what was believed, walked and planned.
const bytes = content => Uint8Array.from(atob(content), letter => letter.charCodeAt(0));
let belief = null;  // {run, upTo, levels}: the belief is logged as changes, so it is replayed
function believed() {
  const {rows, columns, density} = run().scene;
  if (!belief || belief.run !== run() || belief.upTo > at) {
    belief = {run: run(), upTo: -1, levels: new Uint8Array(rows * columns).fill(Math.round(15 * density))};
  }
  while (belief.upTo < at) {
    const box = run().frames[++belief.upTo].belief;
    if (!box) continue;
    const [top, left, height, width, packed] = box, pairs = bytes(packed);
    for (let cell = 0; cell < height * width; cell++) {
      const pair = pairs[cell >> 1];
      belief.levels[(top + Math.floor(cell / width)) * columns + left + cell % width] = cell & 1 ? pair & 15 : pair >> 4;
    }
  }
  return belief.levels;
}
let truth = null;
function wall(cell) {
  if (!truth || truth.run !== run()) truth = {run: run(), bits: bytes(run().scene.truth)};
  return !(truth.bits[cell >> 3] >> (7 - (cell & 7)) & 1);
}
const blend = (from, to, share) => from.map((part, index) => part + (to[index] - part) * share);
function drawMap() {
  const scene = run().scene, canvas = $("map");
  document.querySelector(".desk").classList.toggle("bare", !scene);
  document.querySelector(".map").hidden = !scene;
  if (!scene) return;
  const {rows, columns, step} = scene, unknown = Math.round(15 * scene.density);
  const width = canvas.clientWidth, ratio = Math.min(window.devicePixelRatio || 1, 3);
  const height = Math.round(width * rows / columns);
  canvas.style.height = `${height}px`;
  canvas.width = width * ratio; canvas.height = height * ratio;
  const levels = believed();
  const small = document.createElement("canvas");
  small.width = columns; small.height = rows;
  const image = new ImageData(columns, rows);
  for (let cell = 0; cell < rows * columns; cell++) {
    const level = levels[cell];
    let colour = wall(cell) ? [222, 217, 206] : [243, 240, 233];  // the truth, faint, where nothing is known
    if (level > unknown) colour = blend(colour, [38, 40, 56], (level - unknown) / (15 - unknown));
    if (level < unknown) colour = blend(colour, [255, 255, 255], (unknown - level) / unknown);
    image.data.set([...colour, 255], 4 * cell);
  }
  small.getContext("2d").putImageData(image, 0, 0);
  const pen = canvas.getContext("2d"), scale = canvas.width / columns;
  pen.imageSmoothingEnabled = scale < 1;
  pen.drawImage(small, 0, 0, canvas.width, canvas.height);
  const x = column => (column + .5) / step * scale, y = row => (row + .5) / step * scale;
  const line = (cells, style, thick, dash = []) => {
    if (cells.length < 2) return;
    pen.beginPath();
    cells.forEach(([row, column], index) => index ? pen.lineTo(x(column), y(row)) : pen.moveTo(x(column), y(row)));
    pen.strokeStyle = style; pen.lineWidth = thick * ratio; pen.setLineDash(dash.map(part => part * ratio));
    pen.lineJoin = pen.lineCap = "round"; pen.stroke(); pen.setLineDash([]);
  };
  const middles = plan => plan.map(([level, row, column]) => [(row + .5) * 2 ** level - .5, (column + .5) * 2 ** level - .5]);
  const now = frame(), next = run().frames[at + 1];
  if (now.motion) { drawMotion(canvas, pen, scale / step, ratio); return; }
  for (let index = 0; index < at; index++) line(run().frames[index].path, "rgba(0,114,178,.55)", 1.6);
  const plan = middles(now.plan);
  line(plan, "rgba(255,255,255,.9)", 9); line(plan, "rgba(230,159,0,.85)", 6);
  if (next) { line(middles(next.plan), "#fff", 5); line(middles(next.plan), RED, 2.4, [7, 6]); }
  line(now.path, "#fff", 5); line(now.path, "#0072b2", 2.6);
  const here = now.path.length ? now.path[0] : scene.start, there = now.path.length ? now.path[now.path.length - 1] : here;
  pen.beginPath(); pen.arc(x(here[1]), y(here[0]), scene.radius / step * scale, 0, 7);
  pen.strokeStyle = "#0072b2"; pen.lineWidth = 1.2 * ratio; pen.setLineDash([2 * ratio, 4 * ratio]); pen.stroke(); pen.setLineDash([]);
  const dot = ([row, column], radius, fill, edge) => {
    pen.beginPath(); pen.arc(x(column), y(row), radius * ratio, 0, 7);
    pen.fillStyle = fill; pen.fill(); pen.lineWidth = 2 * ratio; pen.strokeStyle = edge; pen.stroke();
  };
  dot(scene.start, 3, "#fff", INK);
  dot(there, 3.5, "#fff", "#0072b2");
  dot(here, 6, "#0072b2", "#fff");
  for (const [row, column] of scene.goals) star(pen, x(column), y(row), 8 * ratio, ratio);
  const goals = scene.goals.map(([row, column]) => `goal at row ${row}, column ${column}`);
  canvas.setAttribute("aria-label", `Map, frame ${at}: robot at row ${here[0]}, column ${here[1]}, ${goals.join(", ")}`);
}
function star(pen, x, y, size, ratio) {
  pen.lineWidth = 2 * ratio; pen.strokeStyle = "#fff"; pen.fillStyle = "#009e73";
  pen.beginPath();
  for (let point = 0; point < 10; point++) {
    const reach = point % 2 ? size * .45 : size, turn = Math.PI * point / 5;
    pen.lineTo(x + reach * Math.sin(turn), y - reach * Math.cos(turn));
  }
  pen.closePath(); pen.stroke(); pen.fill();
}
function drawLegend() {
  const signs = run().frames.some(each => each.motion) ? motionSigns() : [
    ["robot", make("circle", {cx: 10, cy: 7, r: 5, fill: "#0072b2"})],
    ["goal", make("path", {d: "M10 0L12 5H18L13 8L15 14L10 10L5 14L7 8L2 5H8Z", fill: "#009e73"})],
    ["walked", make("path", {d: "M1 7H19", stroke: "#0072b2", "stroke-width": 2.4})],
    ["plan", make("path", {d: "M1 7H19", stroke: "#e69f00", "stroke-width": 6, opacity: .85})],
    ["next plan", make("path", {d: "M1 7H19", stroke: RED, "stroke-width": 2.4, "stroke-dasharray": "6 4"})],
    ["looks this far", make("circle", {cx: 10, cy: 7, r: 6, fill: "none", stroke: "#0072b2", "stroke-dasharray": "2 2.4"})],
    ["believed blocked", make("rect", {x: 3, width: 14, height: 14, fill: "#26283a"})],
    ["believed free", make("rect", {x: 3.5, y: .5, width: 13, height: 13, fill: "#fff", stroke: RULE})],
    ["wall nobody saw", make("rect", {x: 3, width: 14, height: 14, fill: "#ded9ce"})],
  ];
  drawSigns("legend", signs);
}
function drawSigns(id, signs) {
  $(id).replaceChildren(...signs.map(([name, mark]) => {
    const item = document.createElement("li");
    item.append(make("svg", {width: 20, height: 14, viewBox: "0 0 20 14"}, mark), name);
    return item;
  }));
}
