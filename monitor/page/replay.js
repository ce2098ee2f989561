// What is shown: a mission, a frame, a decision; and what leads from one to the next.
const $ = id => document.getElementById(id);
const live = document.body.dataset.live === "true";
let data = JSON.parse($("data").textContent);
let tab = 0, at = 0, moment = 0;  // shown: mission, frame, decision in the frame
const run = () => data.runs[tab];
const frame = () => run().frames[at];

function write(id, content) { $(id).textContent = content || ""; }
function draw() {
  const it = run(), now = frame();
  drawTabs();
  const head = document.createElement("b");
  head.textContent = it.mission;
  $("mission").replaceChildren(head, ` · ${it.policy}, seed ${it.seed}${it.machine ? ` on machine ${it.machine}` : ""} · ${it.state}`);
  write("losses", it.losses); write("profile", it.profile);
  if (!now) {
    write("sentence", it.ending ? "It ended before a frame was over: 0 decisions." : "No frame is over yet: 0 decisions so far.");
    for (const id of ["where", "why", "fixed", "price", "here", "here-seen", "switching"]) write(id);
    document.querySelectorAll(".chart").forEach(chart => chart.replaceChildren());
    drawWaterfall(); drawRivals();
    return;
  }
  moment = Math.min(moment, now.moments.length - 1);
  const one = now.moments[moment];
  const again = now.moments.length > 1 ? ` · decision ${moment + 1} of ${now.moments.length}` : "";
  const sort = now.standing ? " · standing" : now.interrupted ? " · broken off" : "";
  write("where", `Frame ${at}, ${it.frames.length} in all · ${now.started.toFixed(2)} s – ${now.ended.toFixed(2)} s${again}${sort}`);
  write("sentence", one.headline); write("why", one.why); write("fixed", one.fixed); write("price", one.price);
  write("here", now.here_lost); write("here-seen", now.here_seen);
  write("switching", it.switching);
  write("regretted-all", it.regretted); write("here-regretted", now.here_regretted);
  drawLegend(); drawMap(); drawObjective(); drawCurve(); drawShares(); drawLanes(); drawWaterfall(); drawFrames(); drawSeen(); drawRivals(); drawRegrets();
}
function drawTabs() {
  if (data.runs.length < 2) return;
  const tabs = $("tabs");
  while (tabs.children.length < data.runs.length) {  // those that are there keep the focus
    const button = document.createElement("button"), index = tabs.children.length;
    button.setAttribute("role", "tab");
    button.addEventListener("click", () => show(index));
    tabs.append(button);
  }
  data.runs.forEach((each, index) => {
    const net = document.createElement("small");
    net.textContent = number(each.net);
    tabs.children[index].replaceChildren(each.name, " ", net);
    tabs.children[index].setAttribute("aria-selected", index === tab);
  });
}
function go(index, order = 0) {
  const count = run().frames.length;
  at = Math.max(0, Math.min(count - 1, index));
  moment = order;
  if (count) history.replaceState(null, "", data.runs.length > 1 && tab ? `#${encodeURIComponent(run().name)}:${at}` : `#${at}`);
  draw();
}
function show(index) {
  tab = index;
  go(live ? run().frames.length - 1 : run().opens ?? run().worst[0] ?? 0);
}
function nextDecision() {
  if (moment + 1 < frame().moments.length) go(at, moment + 1);
  else if (at + 1 < run().frames.length) go(at + 1);
}
function nextLoss() {
  const order = run().worst;
  go(order[(order.indexOf(at) + 1) % order.length]);
}
const switches = () => run().frames.flatMap((each, index) => each.motion?.comparisons.some(one => one.taken) ? [index] : []);
function nextSwitch() {
  const order = switches();
  if (order.length) go(order.find(index => index > at) ?? order[0]);
}
function follow() {
  const link = location.hash.slice(1).match(/^(?:(.*):)?(\d+)$/);
  const named = link && link[1] ? data.runs.findIndex(each => encodeURIComponent(each.name) === link[1]) : 0;
  tab = Math.max(0, named);
  if (link && Number(link[2]) < run().frames.length) go(Number(link[2]));
  else show(tab);
}
const acts = {ArrowLeft: () => go(at - 1), ArrowRight: () => go(at + 1), d: nextDecision, l: nextLoss, s: nextSwitch};
addEventListener("keydown", event => {
  if (!acts[event.key] || event.ctrlKey || event.metaKey || event.altKey || !frame()) return;
  event.preventDefault();
  acts[event.key]();
});
[["back", "ArrowLeft"], ["on", "ArrowRight"], ["decision", "d"], ["loss", "l"], ["switch", "s"]].forEach(([id, key]) => $(id).addEventListener("click", () => frame() && acts[key]()));
addEventListener("hashchange", follow);
let width = innerWidth;
addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; draw(); } });
if (data.runs.length) follow();
if (live) {
  const events = new EventSource("events");
  const told = document.title;
  events.onerror = () => { document.title = `not followed: ${told}`; };  // until it is served again
  events.onmessage = async () => {
    const answer = await fetch("data");
    if (!answer.ok) { events.onerror(); return; }
    const newest = at >= run().frames.length - 1;
    data = await answer.json();
    document.title = told;
    belief = truth = null;
    // Another mission may have begun in its place, and have fewer frames.
    if (newest || at >= run().frames.length) go(run().frames.length - 1); else draw();
  };
}
