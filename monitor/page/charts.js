// The charts that answer the questions.
function drawCurve() {
  const now = frame().moments[moment], points = now.curve.filter(point => point[1] !== null);
  if (points.length < 2 || !frame().calls.length) { $("curve").replaceChildren(); return; }
  const height = 190, [svg, width] = picture("curve", height, "Net value against contract time");
  const left = 40, right = width - 12, top = 24, bottom = height - 36;
  const xs = points.map(point => point[0]), ys = points.map(point => point[1]);
  const fixed = run().fixed ?? null, least = Math.min(...xs), most = Math.max(...xs);
  const narrow = least > .5 * most;  // contracts that differ little fill the chart; others begin at 0
  const x0 = narrow ? least - .06 * (most - least) : 0, x1 = Math.max(most, now.contract), high = Math.max(...ys);
  // The least contracts may be a disaster; the lowest quarter is cut off so that the peak can be seen.
  const sorted = [...ys].sort((a, b) => a - b), quarter = sorted[Math.floor(ys.length / 4)];
  const low = high - quarter < .5 * (high - sorted[0]) ? quarter - .6 * (high - quarter) : sorted[0];
  const pad = (high - low || 1) * .12, y0 = low - pad, y1 = high + pad * 1.6;
  const X = value => left + (right - left) * (value - x0) / (x1 - x0 || 1);
  const Y = value => bottom - (bottom - top) * (value - y0) / (y1 - y0);
  const [rows, digits] = ticks(y0, y1, 4);
  for (const mark of rows) {
    svg.append(make("path", {d: `M${left} ${Y(mark)}H${right}`, stroke: RULE}), text(left - 6, Y(mark) + 4, mark.toFixed(digits), {"text-anchor": "end"}));
  }
  const [columns, places] = ticks(x0, x1, width < 360 ? 4 : 6);
  for (const mark of columns) svg.append(text(X(mark), bottom + 16, `${mark.toFixed(places)}`, {"text-anchor": "middle"}));
  svg.append(text(right, height - 4, "seconds of contract", {"text-anchor": "end"}), text(0, 11, "net value foreseen"));
  const clip = make("clipPath", {id: "curve-clip"}, make("rect", {x: left, y: top, width: right - left + 4, height: bottom - top}));
  const line = make("g", {"clip-path": "url(#curve-clip)"});
  line.append(make("polyline", {points: points.map(([a, b]) => `${X(a)},${Y(b)}`).join(" "), fill: "none", stroke: INK, "stroke-width": 1.8, "stroke-linejoin": "round"}));
  for (const [a, b] of points) line.append(pressable(make("circle", {cx: X(a), cy: Y(b), r: 2.2, fill: INK}), `${duration(a)}: ${number(b)}`, () => {}));
  svg.append(clip, line);
  if (fixed !== null && fixed >= x0 && fixed <= x1) {
    svg.append(make("path", {d: `M${X(fixed)} ${bottom + 3}V${top + 12}`, stroke: SOFT, "stroke-dasharray": "2 3"}),
      text(X(fixed) + 4, bottom - 5, "fixed"));
  } else if (fixed !== null) {
    const before = fixed < x0;
    svg.append(text(before ? left + 4 : right, bottom - 5, before ? `← fixed, ${duration(fixed)}` : `fixed, ${duration(fixed)} →`, {"text-anchor": before ? "start" : "end"}));
  }
  const peak = points.reduce((best, point) => point[1] > best[1] ? point : best);
  svg.append(make("circle", {cx: X(peak[0]), cy: Y(peak[1]), r: 9, fill: "none", stroke: RED, "stroke-width": 1.6}));
  if (now.chosen !== null) svg.append(make("circle", {cx: X(now.contract), cy: Y(now.chosen), r: 5, fill: RED}));
  const same = Math.abs(peak[0] - now.contract) < 1e-6 + .01 * x1;
  const label = (spot, level, words) => {
    const end = X(spot) + 16 + 6.3 * words.length > right;
    svg.append(text(X(spot) + (end ? -14 : 14), Y(level) - 8, words, {class: "strong", "text-anchor": end ? "end" : "start"}));
  };
  label(peak[0], peak[1], same ? `chosen: the peak, ${duration(now.contract)}` : `peak, ${duration(peak[0])}`);
  if (!same && now.chosen !== null) svg.append(text(X(now.contract), Y(now.chosen) + 20, `chosen, ${duration(now.contract)}`, {class: "strong", "text-anchor": "middle"}));
}
function drawShares() {
  const now = frame(), chosen = now.moments[moment], names = run().labels;
  const line = 34, height = names.length * line + 2, [svg, width] = picture("shares", height, "Shares of the contract");
  const shades = fills(svg, names);
  const left = Math.min(120, Math.max(64, 8 * Math.max(...names.map(name => name.length)) + 10));
  const told = name => {
    const share = chosen.shares[name] || 0, call = now.calls.find(each => each.label === name);
    return !now.calls.length ? "not called" : call ? `${duration(share)}, took ${duration(call.elapsed)}` : duration(share);
  };
  const right = width - 16 - 6.4 * Math.max(...names.map(name => told(name).length), 14);
  const longest = Math.max(1e-9, ...names.map(name => chosen.shares[name] || 0), ...now.calls.map(call => call.elapsed));
  names.forEach((name, index) => {
    const y = index * line + 5, share = chosen.shares[name] || 0, call = now.calls.find(each => each.label === name);
    const price = chosen.prices[name];
    svg.append(named(0, y + 13, name, left - 8));
    svg.append(make("rect", {x: left, y, width: now.calls.length ? Math.max(1, (right - left) * share / longest) : 0, height: 16, fill: shades[name]}));
    if (call) {
      const used = left + (right - left) * call.elapsed / longest;
      svg.append(pressable(make("path", {d: `M${left} ${y + 20}H${used}M${used} ${y + 16.5}V${y + 23.5}`, stroke: call.overrun > 0 ? RED : INK, "stroke-width": 1.6}), call.text, () => {}));
    }
    svg.append(text(width, y + 13, told(name), {"text-anchor": "end"}));
    if (price !== undefined && price !== null) svg.append(text(width, y + 27, `${price >= 0 ? "+" : ""}${number(price)} a second`, {"text-anchor": "end"}));
  });
}
function drawLanes() {
  const it = run(), job = it.job > 0 ? ["job"] : [];
  const names = [...it.labels, "drive", "wait", ...job, "overrun"];
  const wide = $("lanes").clientWidth > 560, gutter = wide ? 92 : 68, tall = 84, lane = 24;
  const height = tall + names.length * lane + 26, [svg, width] = picture("lanes", height, "Lanes of the mission over time");
  const shades = fills(svg, names), end = Math.max(it.seconds, 1e-9);
  const X = time => gutter + (width - gutter - 8) * time / end, now = frame();
  svg.append(make("rect", {x: X(now.started), y: 0, width: Math.max(2, X(now.ended) - X(now.started)), height: height - 20, fill: "#fbe9c6"}));
  const values = it.frames.flatMap(each => [each.so_far, ...each.moments.map(one => one.net)]).filter(value => value !== null);
  const low = Math.min(...values), high = Math.max(...values), Y = value => tall - 12 - (tall - 26) * (value - low) / (high - low || 1);
  const foreseen = it.frames.some(each => each.moments[0].net !== null);
  svg.append(text(0, 22, "net value"), text(0, 37, "so far –"), text(0, 52, foreseen ? "foreseen ●" : ""));
  svg.append(make("polyline", {points: it.frames.map(each => `${X(each.ended)},${Y(each.so_far)}`).join(" "), fill: "none", stroke: SOFT, "stroke-dasharray": "4 3"}));
  const seen = it.frames.flatMap((each, index) => each.moments.map((one, order) => ({...one, index, order}))).filter(one => one.net !== null);
  svg.append(make("polyline", {points: seen.filter(one => !one.order).map(one => `${X(one.time)},${Y(one.net)}`).join(" "), fill: "none", stroke: "#0072b2", "stroke-width": 1.2, opacity: .7}));
  names.forEach((name, index) => {
    const y = tall + index * lane;
    svg.append(make("path", {d: `M${gutter} ${y + lane - 4}H${width - 8}`, stroke: RULE}), named(0, y + 15, name, gutter - 6));
  });
  const bar = (name, from, to, label, index) => {
    if (to <= from) return;
    const y = tall + names.indexOf(name) * lane;
    svg.append(pressable(make("rect", {x: X(from), y: y + 4, width: Math.max(1, X(to) - X(from) - .8), height: lane - 9, fill: shades[name]}), label, () => go(index)));
  };
  it.frames.forEach((each, index) => {
    const moved = each.started + each.driven;
    bar("drive", each.started, moved, `frame ${index}: drove ${duration(each.driven)}`, index);
    bar("wait", moved, each.ended, `frame ${index}: stood ${duration(each.ended - moved)}`, index);
    for (const call of each.calls) {
      const over = call.started + call.elapsed - call.overrun;
      bar(call.label, call.started, call.started + call.elapsed, `frame ${index}, ${call.text}`, index);
      bar("overrun", over, call.started + call.elapsed, `frame ${index}, ${call.text}`, index);
    }
  });
  if (job.length) bar("job", end - it.job, end, `job ${duration(it.job)}`, it.frames.length - 1);
  const most = Math.max(1e-9, ...seen.map(one => one.worth)), room = Math.min(1, (width - gutter) / it.frames.length / 11);
  for (const one of seen) {
    const current = one.index === at && one.order === moment;
    svg.append(pressable(make("circle", {cx: X(one.time), cy: Y(one.net), r: 1.6 + 4 * room * Math.sqrt(one.worth / most), fill: one.order ? "#fff" : "#0072b2", stroke: current ? RED : "#0072b2", "stroke-width": current ? 2.4 : 1}),
      `frame ${one.index}, ${one.kind === "call" ? "decided again" : "decided"}: ${number(one.net)} foreseen, worth ${number(one.worth)} over the mean contract`, () => go(one.index, one.order)));
  }
  const [marks, digits] = ticks(0, end, wide ? 10 : 4);
  for (const mark of marks) svg.append(text(X(mark), height - 6, mark.toFixed(digits), {"text-anchor": "middle"}));
  svg.append(text(0, height - 6, "seconds"));
}
const changed = by => Math.abs(by) < .005 ? "0" : `${by > 0 ? "+" : "−"}${number(Math.abs(by))}`;
function drawWaterfall() {
  const steps = run().waterfall, line = 25;
  const height = steps.length * line, [svg, width] = picture("waterfall", height, "From the worth of the task to its net value");
  const shades = fills(svg, ["drive", "wait", "energy", "job"]);
  const left = 82, right = width - 58, low = Math.min(0, ...steps.flatMap(step => [step.before, step.after])), high = Math.max(1e-9, ...steps.flatMap(step => [step.before, step.after]));
  const X = value => left + (right - left) * (value - low) / (high - low || 1);
  steps.forEach((step, index) => {
    const y = index * line, from = Math.min(step.before, step.after), to = Math.max(step.before, step.after);
    const names = {drive: "late: drive", wait: "late: wait", job: "late: job"};
    svg.append(text(0, y + 16, names[step.name] || step.name, {class: "strong"}));
    svg.append(make("rect", {x: X(from), y: y + 4, width: Math.max(1, X(to) - X(from)), height: line - 9, fill: step.sum ? INK : shades[step.name] || RED}));
    if (index + 1 < steps.length) svg.append(make("path", {d: `M${X(step.after)} ${y + line - 5}v9`, stroke: SOFT}));
    svg.append(text(width, y + 16, step.sum ? number(step.after) : changed(step.after - step.before), {"text-anchor": "end", class: step.sum ? "strong" : ""}));
  });
}
function apart(frames, step) {  // of the first three, those whose labels touch none of a frame before them
  const kept = [];
  for (const index of frames.slice(0, 3)) if (kept.every(other => Math.abs(index - other) * step > 7 * String(index).length + 2)) kept.push(index);
  return kept;
}
function drawFrames() {
  const it = run(), height = 112, [svg, width] = picture("frames", height, "Loss of each frame");
  const kinds = ["drive", "wait", "energy"], shades = fills(svg, kinds), top = 16;
  // Where net value was foreseen: how it fell (▼, down, red) or rose over each frame; else what was used up.
  const foreseen = it.frames.every(each => each.fell !== null), falls = it.frames.map(each => each.fell);
  const sizes = foreseen ? falls : it.frames.map(each => each.lost.reduce((a, b) => a + b));
  const rise = foreseen ? Math.max(0, ...falls.map(fall => -fall)) : 0, fall = Math.max(0, ...sizes), room = height - 36;
  const unit = room / (rise + fall || 1), most = fall || 1e-9;
  const bottom = foreseen ? top / 4 + rise * unit : height - 20;
  const step = width / it.frames.length, worst = apart(it.worst.filter(index => sizes[index] > 0), step);
  const base = make("path", {d: `M0 ${bottom + .5}H${width}`, stroke: INK});
  it.frames.forEach((each, index) => {
    let up = bottom;
    const group = make("g");
    if (index === at) group.append(make("rect", {x: index * step, y: 0, width: step, height: height - 20, fill: "#fbe9c6"}));
    else group.append(make("rect", {x: index * step, y: 0, width: step, height: height - 20, fill: "transparent"}));
    if (foreseen) {
      const down = each.fell > 0, tall = Math.abs(each.fell) * unit;
      group.append(make("rect", {x: index * step + step * .14, y: down ? bottom : bottom - tall, width: Math.max(1, step * .72), height: tall, fill: down ? RED : "#fff", stroke: down ? RED : "#0072b2"}));
    } else each.lost.forEach((part, kind) => {
      const tall = Math.max(0, (bottom - top) * part / most);
      up -= tall;
      group.append(make("rect", {x: index * step + step * .12, y: up, width: Math.max(1, step * .76), height: tall, fill: shades[kinds[kind]]}));
    });
    if (worst.includes(index)) group.append(text((index + .5) * step, foreseen ? Math.min(height - 22, bottom + Math.max(0, each.fell) * unit + 13) : up - 4, index, {"text-anchor": "middle", class: "strong"}));
    svg.append(pressable(group, each.here_lost, () => go(index)));
  });
  svg.append(base, text(0, height - 4, foreseen ? "net value foreseen: ■ lost, □ won in each frame" : "used up, frame by frame"));
}
function drawSeen() {
  const points = run().compared;
  if (!points.length) { $("seen").replaceChildren(); return; }
  const height = 190, [svg, width] = picture("seen", height, "Advertised and seen quality by frame");
  const left = 30, right = width - 8, top = 24, bottom = height - 32;
  const last = Math.max(1, run().frames.length - 1), X = index => left + 9 + (right - left - 9) * index / last, Y = value => bottom - (bottom - top) * value;
  for (const mark of [0, .5, 1]) svg.append(make("path", {d: `M${left} ${Y(mark)}H${right}`, stroke: RULE}), text(left - 6, Y(mark) + 4, number(mark).replace("0.00", "0").replace("1.00", "1"), {"text-anchor": "end"}));
  const clip = value => Math.min(1, Math.max(0, value));
  const over = points.map(([index, level]) => `${X(index)},${Y(clip(level + data.band))}`), under = points.map(([index, level]) => `${X(index)},${Y(clip(level - data.band))}`).reverse();
  svg.append(make("polygon", {points: [...over, ...under].join(" "), fill: "#dbe9f1"}));
  svg.append(make("polyline", {points: points.map(([index, level]) => `${X(index)},${Y(level)}`).join(" "), fill: "none", stroke: "#0072b2", "stroke-width": 1.6}));
  for (const [index, level, seen] of points) {
    const off = Math.abs(seen - level) > data.band, x = X(index), y = Y(clip(seen));
    const mark = off ? make("path", {d: `M${x - 3.5} ${y - 3.5}l7 7m0 -7l-7 7`, stroke: RED, "stroke-width": 2}) : make("circle", {cx: x, cy: y, r: 3.2, fill: INK});
    if (index === at) svg.append(make("circle", {cx: x, cy: y, r: 8, fill: "none", stroke: RED}));
    svg.append(pressable(mark, `frame ${index}: advertised ${number(level)}, seen ${number(seen)}${off ? ", off the band" : ""}`, () => go(index)));
  }
  svg.append(text(0, 11, "quality: line advertised, ● seen, × off the band"), text(right, height - 4, "frame", {"text-anchor": "end"}));
  const [marks] = ticks(0, last, 5);
  for (const mark of marks) if (Number.isInteger(mark)) svg.append(text(X(mark), bottom + 16, mark, {"text-anchor": "middle"}));
}
function drawRivals() {
  const rivals = data.runs.filter(each => each.mission === run().mission && each.seed === run().seed);
  if (rivals.length < 2) { $("rivals").replaceChildren(); return; }
  const line = 27, [svg, width] = picture("rivals", rivals.length * line + 4, "Net value of each policy");
  const nets = rivals.map(each => each.net ?? 0), low = Math.min(0, ...nets), high = Math.max(1e-9, ...nets), left = 82, right = width - 58;
  const X = value => left + (right - left) * (value - low) / (high - low || 1);
  rivals.forEach((each, order) => {
    const index = data.runs.indexOf(each), y = order * line, net = each.net ?? 0, group = make("g");
    group.append(named(0, y + 17, each.name, left - 6, {class: index === tab ? "strong" : ""}),
      make("rect", {x: X(Math.min(0, net)), y: y + 5, width: Math.max(1, Math.abs(X(net) - X(0))), height: line - 11, fill: index === tab ? INK : "#b9b3a6"}),
      text(width, y + 17, number(net), {"text-anchor": "end", class: index === tab ? "strong" : ""}));
    svg.append(pressable(group, `${each.name}: ${each.state}`, () => show(index)));
  });
}
// Missions lived again with other decisions: the regret of each frame, and the forks of this one.
function drawRegrets() {
  const it = run();
  $("regretted").hidden = !it.regretted;
  if (!it.regretted) return;
  drawRegret(it); drawForks(it);
}
function drawRegret(it) {
  const height = 190, [svg, width] = picture("regret", height, "Regret of each frame");
  const top = 40, bottom = height - 32, step = width / it.frames.length, forked = it.frames.filter(each => each.forks);
  const most = Math.max(1e-9, ...forked.map(each => each.forks.regret));
  const worst = apart([...forked].sort((a, b) => b.forks.regret - a.forks.regret).filter(each => each.forks.regret > 0).map(each => each.index), step);
  forked.forEach(each => {
    const index = each.index, regret = each.forks.regret, tall = (bottom - top) * regret / most, group = make("g");
    group.append(make("rect", {x: index * step, y: top - 20, width: step, height: bottom - top + 20, fill: index === at ? "#fbe9c6" : "transparent"}),
      make("rect", {x: index * step + step * .14, y: bottom - tall, width: Math.max(1, step * .72), height: tall, fill: RED}));
    if (worst.includes(index)) group.append(text((index + .5) * step, bottom - tall - 4, index, {"text-anchor": "middle", class: "strong"}));
    svg.append(pressable(group, `frame ${index}: ${number(regret)} more by the best of ${each.forks.made.length} others`, () => go(index)));
  });
  svg.append(make("path", {d: `M0 ${bottom + .5}H${width}`, stroke: INK}), text(0, 11, `${width < 460 ? "added by the best other decision" : "net value that the best other decision would have added"}, at most ${number(most > 1e-9 ? most : 0)}`), text(width, height - 2, "frame", {"text-anchor": "end"}));
  for (const mark of ticks(0, it.frames.length - 1, 8)[0]) if (Number.isInteger(mark)) svg.append(text((mark + .5) * step, bottom + 15, mark, {"text-anchor": "middle"}));
}
function drawForks(it) {
  const now = frame(), forks = now.forks;
  if (!forks) { $("forks").replaceChildren(); return; }
  const height = 190, [svg, width] = picture("forks", height, "Net value of the mission with other decisions in this frame");
  const top = 22, bottom = height - 32, gutter = 40, middle = (width - gutter + 18) / 2, best = Math.max(...forks.made.map(one => one.net));
  const nets = [it.net, ...forks.made.map(one => one.net)], low = Math.min(...nets), high = Math.max(...nets), pad = (high - low || 1) * .1;
  const Y = value => bottom - (bottom - top) * (value - low + pad) / (high - low + 2 * pad);
  const [rows, digits] = ticks(low - pad, high + pad, 4);
  for (const mark of rows) svg.append(make("path", {d: `M${gutter} ${Y(mark)}H${width}`, stroke: RULE}), text(gutter - 6, Y(mark) + 4, mark.toFixed(digits), {"text-anchor": "end"}));
  svg.append(text(0, 11, "net value of the whole mission: ● lived, ○ forked"), make("path", {d: `M${gutter} ${Y(it.net)}H${width}`, stroke: INK, "stroke-dasharray": "4 3"}));
  const panel = (from, name, own, points) => {
    const xs = [own, ...points.map(one => one.at)], least = Math.min(...xs), most = Math.max(...xs), room = middle - 34;
    const X = value => from + 8 + room * (value - least) / (most - least || 1);
    for (const one of points) svg.append(pressable(make("circle", {cx: X(one.at), cy: Y(one.net), r: one.net === best && best > it.net ? 5 : 3.4, fill: "#fff", stroke: one.net > it.net ? RED : INK, "stroke-width": one.net === best && best > it.net ? 2.4 : 1.2}), one.text, () => {}));
    svg.append(make("circle", {cx: X(own), cy: Y(it.net), r: 4.5, fill: INK}));
    const [marks, places] = ticks(least, most, 4);
    for (const mark of marks) svg.append(text(X(mark), bottom + 15, mark.toFixed(places), {"text-anchor": "middle"}));
    svg.append(text(from + 8 + room, height - 2, name, {"text-anchor": "end"}));
  };
  const decided = now.moments[0], timed = forks.made.filter(one => one.timed);
  if (timed.length) panel(gutter, "seconds of contract", decided.contract, timed.map(one => ({...one, at: one.contract})));
  const driven = forks.made.filter(one => !one.timed);
  if (driven.length) panel(timed.length ? gutter + middle : gutter, it.unit, decided.speed, driven.map(one => ({...one, at: one.speed})));
}
