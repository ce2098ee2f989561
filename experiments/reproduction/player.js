// Plays the animations of the page: each is a figure with its data, a canvas, a button and a slider.
const SECONDS = 8;  // that one takes, however long what it shows took
const INK = "#222", SOFT = "#777", GOAL = "#009e73";

for (const figure of document.querySelectorAll("figure.animation")) {
  const told = JSON.parse(figure.querySelector("script").textContent), moments = told.moments;
  const canvas = figure.querySelector("canvas"), button = figure.querySelector("button");
  const slider = figure.querySelector("input"), clock = figure.querySelector("output");
  const [left, lower, right, upper] = told.box, floor = drawnFloor(told.floor, right, upper);
  let at = moments.length - 1, begun = null;

  const show = index => {
    at = index;
    slider.value = at;
    const now = moments[at];
    clock.value = `${now.at} ${told.clock}${now.said ? `: ${now.said}` : ""}`;
    draw(now);
  };
  const play = on => {
    begun = on ? performance.now() - 1000 * SECONDS * (at + 1 < moments.length ? at / moments.length : 0) : null;
    button.textContent = on ? "❚❚" : "▶";
    button.setAttribute("aria-label", on ? "stop" : "play");
    if (on) requestAnimationFrame(step);
  };
  const step = time => {
    if (begun === null) return;
    const next = Math.max(0, Math.floor((time - begun) / 1000 / SECONDS * moments.length));
    if (next >= moments.length) { show(moments.length - 1); play(false); return; }
    if (next !== at) show(next);
    requestAnimationFrame(step);
  };

  function draw(now) {
    const ratio = Math.min(window.devicePixelRatio || 1, 3), margin = 26 * ratio;
    const width = canvas.clientWidth * ratio, unit = (width - margin) / (right - left);
    canvas.width = width; canvas.height = Math.round(unit * (upper - lower) + margin);
    canvas.style.height = `${canvas.height / ratio}px`;
    const pen = canvas.getContext("2d"), X = x => margin + (x - left) * unit, Y = y => (upper - y) * unit;
    const stroke = (style, thick, dash = []) => {
      pen.strokeStyle = style; pen.lineWidth = thick * ratio; pen.setLineDash(dash.map(part => part * ratio));
      pen.lineJoin = "round"; pen.stroke(); pen.setLineDash([]);
    };
    const disc = ([x, y, radius]) => { pen.beginPath(); pen.arc(X(x), Y(y), radius * unit, 0, 7); };

    pen.imageSmoothingEnabled = false;
    if (floor) pen.drawImage(floor, X(0), Y(upper), unit * right, unit * upper);
    axes(pen, X, Y, ratio, width, canvas.height - margin);
    pen.save(); pen.beginPath(); pen.rect(margin, 0, width, canvas.height - margin); pen.clip();
    for (const one of now.discs ?? []) { disc(one); pen.fillStyle = "rgba(60,60,60,.35)"; pen.fill(); stroke(INK, 1); }
    for (const one of now.rings ?? []) { disc(one); stroke(INK, 1, [2, 3]); }
    for (const [x, y, side] of now.squares ?? []) {
      pen.beginPath(); pen.rect(X(x), Y(y + side), side * unit, side * unit); stroke("#0072b2", 1, [3, 2]);
    }
    (now.lines ?? []).forEach((places, index) => {
      pen.beginPath();
      const all = told.lines[index].grows ? moments.slice(0, at + 1).flatMap(each => each.lines[index]) : places;
      for (const [x, y] of all) pen.lineTo(X(x), Y(y));
      stroke(told.lines[index].colour, 2, told.lines[index].dash);
    });
    if (now.robot) {
      const [x, y, heading, radius] = now.robot;
      disc([x, y, radius]); pen.fillStyle = "rgba(0,114,178,.2)"; pen.fill(); stroke("#0072b2", 1.5);
      pen.beginPath(); pen.moveTo(X(x), Y(y));
      pen.lineTo(X(x + radius * Math.cos(heading)), Y(y + radius * Math.sin(heading))); stroke("#0072b2", 2);
    }
    if (now.goal) {
      const [x, y] = now.goal, size = 5 * ratio;
      pen.beginPath();
      pen.moveTo(X(x) - size, Y(y)); pen.lineTo(X(x) + size, Y(y)); pen.moveTo(X(x), Y(y) - size); pen.lineTo(X(x), Y(y) + size);
      stroke("#fff", 5); stroke(GOAL, 2.5);
    }
    pen.restore();
    canvas.setAttribute("aria-label", `${told.title}, ${clock.value}`);
  }

  function axes(pen, X, Y, ratio, width, bottom) {
    const apart = [.2, .5, 1, 2, 5, 10, 20, 50].find(step => (right - left) / step <= 8);
    pen.strokeStyle = "#ddd"; pen.fillStyle = SOFT; pen.lineWidth = ratio;
    pen.font = `${10 * ratio}px system-ui, sans-serif`; pen.textAlign = "center"; pen.textBaseline = "top";
    const marks = (from, to) => Array.from({length: Math.floor(to / apart + 1e-9) - Math.ceil(from / apart - 1e-9) + 1}, (_, index) => (Math.ceil(from / apart - 1e-9) + index) * apart);
    const name = mark => String(Math.round(10 * mark) / 10);
    const across = marks(left, right), up = marks(lower, upper);
    across.forEach((mark, index) => {
      if (!floor) { pen.beginPath(); pen.moveTo(X(mark), 0); pen.lineTo(X(mark), bottom); pen.stroke(); }
      const unit = index === across.length - 1 ? ` ${told.unit}` : "";
      pen.textAlign = X(mark) > width - 24 * ratio ? "right" : "center";
      pen.fillText(name(mark) + unit, Math.min(X(mark), width), bottom + 5 * ratio);
    });
    pen.textAlign = "right"; pen.textBaseline = "middle";
    for (const mark of up) {
      if (!floor) { pen.beginPath(); pen.moveTo(X(left), Y(mark)); pen.lineTo(width, Y(mark)); pen.stroke(); }
      if (Y(mark) < bottom - 4 * ratio) pen.fillText(name(mark), X(left) - 4 * ratio, Math.max(Y(mark), 6 * ratio));
    }
    pen.strokeStyle = SOFT; pen.strokeRect(X(left), 0, width - X(left), bottom);
  }

  slider.max = moments.length - 1;
  slider.addEventListener("input", () => { play(false); show(Number(slider.value)); });
  button.addEventListener("click", () => play(begun === null));
  new ResizeObserver(() => draw(moments[at])).observe(figure);
  show(at);
}

function drawnFloor(rows, columns, height) {
  if (!rows?.length) return null;
  const image = document.createElement("canvas");
  image.width = columns; image.height = height;
  const pen = image.getContext("2d");
  pen.fillStyle = "#bbb";
  rows.forEach((row, up) => {
    for (let column = 0; column < columns; column++) {
      if (parseInt(row[column >> 2], 16) >> (3 - (column & 3)) & 1) pen.fillRect(column, height - 1 - up, 1, 1);
    }
  });
  return image;
}
