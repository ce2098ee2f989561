// A robot that moves in metres: its body, what its sonars heard, and the plans that it compared.
const BLUE = "#0072b2", PLAN = "#e69f00", OTHER = "#a8558a", GIVEN_UP = "#6d6a66";
const GHOST = 4;  // cells between two outlines of where the robot was
const metres = value => `${(value < .0995 ? value.toFixed(3) : value.toFixed(2)).replace(/\.?0+$/, "").replace(/^0\./, ".")} m`;
const moves = () => run().frames.slice(0, at + 1).filter(each => each.motion).map(each => each.motion);
function drawMotion(canvas, pen, unit, ratio) {
  const scene = run().scene, now = frame().motion, seen = moves();
  const x = column => column * unit, y = row => row * unit;
  const stroke = (style, thick, dash = []) => {
    pen.strokeStyle = style; pen.lineWidth = thick * ratio; pen.setLineDash(dash.map(part => part * ratio));
    pen.lineJoin = pen.lineCap = "round"; pen.stroke(); pen.setLineDash([]);
  };
  const line = (places, style, thick, dash) => {
    if (places.length < 2) return;
    pen.beginPath();
    for (const [row, column] of places) pen.lineTo(x(column), y(row));
    stroke(style, thick, dash);
  };
  const disc = (row, column, radius) => { pen.beginPath(); pen.arc(x(column), y(row), radius * unit, 0, 7); };
  const words = (content, left, top, align = "center") => {
    pen.font = `${12 * ratio}px "Avenir Next", "Segoe UI", "Liberation Sans", Arial, sans-serif`;
    pen.textAlign = align; pen.textBaseline = "middle"; pen.lineJoin = "round";
    pen.lineWidth = 4 * ratio; pen.strokeStyle = "rgba(255,255,255,.9)"; pen.strokeText(content, left, top);
    pen.fillStyle = INK; pen.fillText(content, left, top);
  };

  pen.beginPath();  // the truth, faint, also where it is believed to be free
  for (let cell = 0; cell < scene.rows * scene.columns; cell++) {
    if (wall(cell)) pen.rect(x(cell % scene.columns * scene.step), y(Math.floor(cell / scene.columns) * scene.step), x(scene.step), y(scene.step));
  }
  pen.fillStyle = "rgba(140,128,100,.26)"; pen.fill();
  for (const [row, column, bearing, half, reach, heard] of now.cones) {
    pen.beginPath(); pen.moveTo(x(column), y(row));
    pen.arc(x(column), y(row), (heard ?? reach) * unit, -bearing - half, -bearing + half); pen.closePath();
    pen.fillStyle = heard === null ? "rgba(0,114,178,.05)" : "rgba(0,114,178,.16)"; pen.fill();
    if (heard === null) { stroke("rgba(0,114,178,.3)", 1, [2, 5]); continue; }
    pen.beginPath(); pen.arc(x(column), y(row), heard * unit, -bearing - half, -bearing + half);
    stroke("#fff", 6); stroke(BLUE, 3.2);
  }
  for (const [row, column, radius] of now.discs) {
    disc(row, column, radius + now.clearance); stroke("rgba(34,34,42,.55)", 1, [1, 4]);
    disc(row, column, radius); pen.fillStyle = "rgba(38,40,56,.3)"; pen.fill(); stroke(INK, 1.6);
  }
  const track = seen.flatMap(each => each.track);
  let last = track[0];
  for (const pose of track) {
    if (Math.hypot(pose[0] - last[0], pose[1] - last[1]) < GHOST) continue;
    last = pose;
    disc(pose[0], pose[1], now.radius); stroke("rgba(0,114,178,.22)", 1);
  }
  line(now.plan, "rgba(255,255,255,.9)", 9); line(now.plan, PLAN, 6);
  for (const one of now.comparisons) {
    line(one.other, "#fff", 4);
    line(one.other, one.taken ? GIVEN_UP : OTHER, 2, one.taken ? [2, 5] : [7, 5]);
  }
  line(track, "#fff", 4); line(track, BLUE, 2.2);

  const [row, column, heading] = now.track[now.track.length - 1], cos = Math.cos(heading), sin = -Math.sin(heading);
  disc(row, column, now.radius); pen.fillStyle = "rgba(0,114,178,.28)"; pen.fill(); stroke("#fff", 4); stroke(BLUE, 2.2);
  const tip = (ahead, aside) => [x(column) + (ahead * cos - aside * sin) * now.radius * unit, y(row) + (ahead * sin + aside * cos) * now.radius * unit];
  pen.beginPath();
  for (const [ahead, aside] of [[.92, 0], [-.35, .5], [-.1, 0], [-.35, -.5]]) pen.lineTo(...tip(ahead, aside));
  pen.closePath(); pen.fillStyle = BLUE; pen.fill();
  const goal = now.goal ?? [scene.goals[0][0] + .5, scene.goals[0][1] + .5];
  star(pen, x(goal[1]), y(goal[0]), 9 * ratio, ratio);
  for (const each of seen) for (const [, what] of each.events) {
    const [top, left] = each.track[each.track.length - 1], size = 6 * ratio;
    pen.beginPath(); pen.moveTo(x(left) - size, y(top) - size); pen.lineTo(x(left) + size, y(top) + size);
    pen.moveTo(x(left) + size, y(top) - size); pen.lineTo(x(left) - size, y(top) + size);
    stroke("#fff", 5.5); stroke(RED, 2.6); words(what, x(left), y(top) - now.radius * unit - 10 * ratio);
  }
  for (const [top, left, bearing, , , heard] of now.cones) {
    if (heard === null) continue;
    const reach = heard * unit + 30 * ratio;
    words(metres(heard * scene.resolution), x(left) + reach * Math.cos(bearing), y(top) - reach * Math.sin(bearing));
  }
  canvas.setAttribute("aria-label", `Map, frame ${at}: robot at row ${row.toFixed(1)}, column ${column.toFixed(1)}, heading ${heading.toFixed(2)}; goal at row ${goal[0].toFixed(1)}, column ${goal[1].toFixed(1)}`);
}
function motionSigns() {
  const one = frame()?.motion?.comparisons.at(-1), value = shown => shown === undefined ? "" : `, ${metres(shown)}`;
  const [plan, other, gone] = !one ? [] : one.taken ? [one.found, undefined, one.idle ? undefined : one.held] : [one.idle ? undefined : one.held, one.found];
  return [
    ["robot and heading", make("g", {}, make("circle", {cx: 10, cy: 7, r: 6, fill: "rgba(0,114,178,.28)", stroke: BLUE, "stroke-width": 1.6}), make("path", {d: "M15 7L8 10L9.5 7L8 4Z", fill: BLUE}))],
    ["goal", make("path", {d: "M10 0L12 5H18L13 8L15 14L10 10L5 14L7 8L2 5H8Z", fill: "#009e73"})],
    ["walked", make("path", {d: "M1 7H19", stroke: BLUE, "stroke-width": 2.4})],
    [`plan in execution${value(plan)}`, make("path", {d: "M1 7H19", stroke: PLAN, "stroke-width": 6})],
    [`alternative, not taken${value(other)}`, make("path", {d: "M1 7H19", stroke: OTHER, "stroke-width": 2, "stroke-dasharray": "5 3.5"})],
    [`given up for it${value(gone)}`, make("path", {d: "M1 7H19", stroke: GIVEN_UP, "stroke-width": 2, "stroke-dasharray": "1.5 3.5"})],
    ["sonar: heard there", make("g", {}, make("path", {d: "M2 7L16 1A16 16 0 0 1 16 13Z", fill: "rgba(0,114,178,.16)"}), make("path", {d: "M16 1A16 16 0 0 1 16 13", fill: "none", stroke: BLUE, "stroke-width": 2.6}))],
    ["sonar: no echo", make("path", {d: "M2 7L17 1A16 16 0 0 1 17 13Z", fill: "rgba(0,114,178,.05)", stroke: "rgba(0,114,178,.5)", "stroke-dasharray": "1.5 3"})],
    ["obstacle believed, and what is kept clear", make("g", {}, make("circle", {cx: 10, cy: 7, r: 3.6, fill: "rgba(38,40,56,.3)", stroke: INK, "stroke-width": 1.4}), make("circle", {cx: 10, cy: 7, r: 6.4, fill: "none", stroke: INK, "stroke-dasharray": "1 2.4"}))],
    ["cells believed blocked", make("rect", {x: 3, width: 14, height: 14, fill: "#26283a"})],
    ["free", make("rect", {x: 3.5, y: .5, width: 13, height: 13, fill: "#fff", stroke: RULE})],
    ["nothing heard yet", make("rect", {x: 3.5, y: .5, width: 13, height: 13, fill: FAINT, stroke: RULE})],
    ["what is really there", make("rect", {x: 3, width: 14, height: 14, fill: "#ded9ce"})],
  ];
}
function drawObjective() {
  const it = run(), points = it.frames.flatMap((each, index) => (each.motion?.comparisons ?? []).map(one => ({...one, index})));
  $("plans").hidden = !points.length;
  for (const id of ["switch", "switch-key"]) $(id).hidden = !points.length;
  if (!points.length) return;
  drawSigns("signs", [
    ["objective of the plan in execution: metres left, and effort", make("path", {d: "M1 7H19", stroke: PLAN, "stroke-width": 2.6})],
    ["of the best alternative", make("circle", {cx: 10, cy: 7, r: 3, fill: "#fff", stroke: OTHER, "stroke-width": 1.3})],
    ["switched to it", make("path", {d: "M10 2l5 5l-5 5l-5 -5Z", fill: OTHER})],
    ["begun from nothing", make("path", {d: "M10 2l5 9h-10Z", fill: OTHER})],
    ["something happened", make("path", {d: "M6 3l8 8m0 -8l-8 8", stroke: RED, "stroke-width": 1.8})],
  ]);
  const wide = $("objective").clientWidth > 560, gutter = wide ? 92 : 68, top = 28, bottom = 180, height = 206;
  const [svg, width] = picture("objective", height, "Objective of the plan in execution and of the best alternative over time");
  const end = Math.max(it.seconds, 1e-9), values = points.flatMap(one => one.idle ? [one.found] : [one.held, one.found]).sort((a, b) => a - b);
  // A plan that would lead far astray is drawn at the upper edge, so that the others can be told apart.
  const highest = values[values.length - 1], most = Math.min(highest, 1.5 * values[Math.floor(.95 * (values.length - 1))]) || 1;
  const X = time => gutter + (width - gutter - 8) * time / end, Y = value => bottom - (bottom - top) * Math.min(value, most) / most;
  const now = frame();
  svg.append(make("rect", {class: "cursor", x: X(now.started), y: 0, width: Math.max(2, X(now.ended) - X(now.started)), height: bottom, fill: "#fbe9c6"}));
  const [rows, digits] = ticks(0, most, 4);
  for (const mark of rows) svg.append(make("path", {d: `M${gutter} ${Y(mark)}H${width - 8}`, stroke: RULE}), text(gutter - 6, Y(mark) + 4, mark.toFixed(digits), {"text-anchor": "end"}));
  let path = "", before = null;
  for (const one of points) {
    if (!one.idle) path += `${before === null || one.index - before > 1 ? "M" : "L"}${X(one.time)} ${Y(one.held)}`;
    if (one.taken) path += `${one.idle ? "M" : "L"}${X(one.time)} ${Y(one.found)}`;
    before = one.idle && !one.taken ? null : one.index;
  }
  svg.append(make("path", {class: "held", d: path, fill: "none", stroke: PLAN, "stroke-width": 2.6, "stroke-linejoin": "round"}));
  for (const one of points) {
    const sign = one.taken && !one.idle;
    if (sign) svg.append(make("path", {class: "switched", d: `M${X(one.time)} ${bottom}V${top - 8}`, stroke: SOFT, "stroke-width": 1, "stroke-dasharray": "1 4"}));
    const mark = sign ? make("path", {d: `M${X(one.time)} ${Y(one.found) - 5}l5 5l-5 5l-5 -5Z`, fill: OTHER, stroke: "#fff"})
      : one.taken ? make("path", {d: `M${X(one.time)} ${Y(one.found) - 5}l5 9h-10Z`, fill: OTHER, stroke: "#fff"})
      : make("circle", {cx: X(one.time), cy: Y(one.found), r: 2.4, fill: "#fff", stroke: OTHER, "stroke-width": 1.3});
    mark.classList.add(sign ? "switch" : one.taken ? "begin" : "found");
    svg.append(pressable(mark, `${one.time.toFixed(2)} s, frame ${one.index}: ${one.text}`, () => go(one.index)));
  }
  for (const each of it.frames) for (const [time, what] of each.motion?.events ?? []) {
    const left = X(time), right = left > width - 90;
    svg.append(make("path", {class: "event", d: `M${left} ${bottom}V${top - 14}m-4 -4l8 8m0 -8l-8 8`, stroke: RED, "stroke-width": 1.8, fill: "none"}),
      text(left + (right ? -8 : 8), top - 12, what, {class: "strong", "text-anchor": right ? "end" : "start"}));
  }
  svg.append(text(0, top + 4, "metres"));
  if (most < highest) svg.append(text(width - 8, 11, `cut off: up to ${metres(highest)}`, {"text-anchor": "end"}));
  const [marks, places] = ticks(0, end, wide ? 10 : 4);
  for (const mark of marks) svg.append(text(X(mark), height - 6, mark.toFixed(places), {"text-anchor": "middle"}));
  svg.append(text(0, height - 6, "seconds"));
}
