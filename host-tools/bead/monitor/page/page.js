// What the server sends goes into the page as text only: textContent, and numbers into canvases.
"use strict";
const element = id => document.getElementById(id);
const STRIKES_MOST = 500;
const state = { beads: [], strikes: [], last: new Map(), chosen: null, plots: null };

const withU = (value, u) => {
  if (!(u > 0)) return value.toFixed(2);
  const digits = Math.min(6, Math.max(0, 1 - Math.floor(Math.log10(u))));
  return value.toFixed(digits) + " ± " + u.toFixed(digits);
};

const fill = (body, rows) => body.replaceChildren(...rows.map(([cells, chosen, press]) => {
  const row = document.createElement("tr");
  row.className = chosen ? "chosen" : "";
  row.addEventListener("click", press);
  for (const cell of cells) row.insertCell().textContent = cell;
  return row;
}));

const choose = bead => {
  state.chosen = bead;
  drawBeads();
  drawStrike();
};

function drawBeads() {
  const rows = state.beads.map(bead => {
    const faults = bead.standing.join(", ");
    const losses = bead.losses.map(loss => loss.count + " " + loss.cause).join(", ");
    return [[
      bead.bead,
      bead.silent_s !== null ? "silent " + bead.silent_s + " s" : faults || "good",
      bead.armed === null ? "" : bead.armed ? "armed" : "disarmed",
      bead.strikes,
      bead.frames,
      bead.supply_v === null ? "" : bead.supply_v.toFixed(3) + " V",
      bead.clock_ppm === null ? "" : withU(bead.clock_ppm[0], bead.clock_ppm[1]),
      losses || "none",
      bead.port,
    ], bead.bead === state.chosen, () => choose(bead.bead)];
  });
  fill(document.querySelector("#beads tbody"), rows);
}

function drawList() {
  const rows = state.strikes.slice(-100).reverse().map(strike => [[
    strike.bead,
    strike.strike,
    withU(strike.peak_force_n, strike.peak_force_u),
    withU(strike.absorbed_measured_nj, strike.absorbed_measured_u),
    withU(strike.absorbed_predicted_nj, strike.absorbed_predicted_u),
    strike.flags.join(", "),
  ], false, () => choose(strike.bead)]);
  fill(document.querySelector("#strikes tbody"), rows);
}

function makePlots(width) {
  const text = getComputedStyle(document.body).color;
  const plot = ([name, color]) => new uPlot({
    title: name, width, height: 220, legend: { show: false }, cursor: { drag: { x: true, y: false } },
    scales: { x: { time: false } },
    series: [{}, { stroke: color, width: 1.5 }],
    axes: [
      { stroke: text, grid: { stroke: "#8884" }, values: (_, values) => values.map(value => value + " ms") },
      { stroke: text, grid: { stroke: "#8884" }, size: 60 },
    ],
  }, [[], []], element("curves"));
  return [["Force, N", "#1f77b4"], ["Acceleration, m/s²", "#d98200"], ["Residual, m/s²", "#a54bb5"]].map(plot);
}

function drawStrike() {
  const strike = state.last.get(state.chosen);
  if (!strike) return;
  const at = strike.at_s === null ? "" : " at " + strike.at_s.toFixed(5) + " s";
  element("strike").textContent = "Bead " + strike.bead + ", strike " + strike.strike + at + ": "
    + withU(strike.peak_force_n, strike.peak_force_u) + " N";
  const residual = strike.residual === null ? "" : "; residual " + (100 * strike.residual).toFixed(2) + " %";
  element("energies").textContent = "A, measured " + withU(strike.absorbed_measured_nj, strike.absorbed_measured_u)
    + " nJ; B, predicted " + withU(strike.absorbed_predicted_nj, strike.absorbed_predicted_u) + " nJ" + residual
    + "; " + (strike.flags.join(", ") || "no flags");
  const curves = strike.curves;
  if (!curves) return;
  const width = element("curves").clientWidth / 3 - 8;
  state.plots ??= makePlots(width);
  const times = curves.force_n.map((_, place) => curves.from_ms + curves.step_ms * place);
  [curves.force_n, curves.acceleration, curves.residual].forEach((values, place) => {
    state.plots[place].setData([times.slice(0, values.length), values]);
  });
}

// Beads over time: the force of each at its place, on the time that all beads have from the edges at their sync
// inputs.
function drawRow() {
  const all = [...state.last.values()].filter(strike => strike.curves && strike.after_edge_ms !== null && strike.received_ms);
  const newest = Math.max(...all.map(strike => strike.received_ms));
  const last = all.find(strike => strike.received_ms === newest);
  // One wave is at all beads within 20 ms. An edge may lie between two of them.
  const after = strike => {
    const time = strike.after_edge_ms - last.after_edge_ms, period = last.edge_period_ms;
    return period > 0 ? time - period * Math.round(time / period) : time;
  };
  const row = all.filter(strike => newest - strike.received_ms < 2000 && Math.abs(after(strike)) < 20)
    .sort((a, b) => a.bead - b.bead);
  const canvas = element("row"), context = canvas.getContext("2d");
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = Math.max(180, 70 + 34 * row.length);
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  canvas.style.height = height + "px";
  context.scale(ratio, ratio);
  if (row.length < 2) {
    element("row-note").textContent = "needs strikes of two beads with edges at their sync inputs (docs/row.md)";
    return;
  }
  const first = row[0];
  const starts = row.map(strike => after(strike) - after(first));
  const peak = Math.max(...row.flatMap(strike => strike.curves.force_n));
  const from = Math.min(...starts) - 0.3, to = Math.max(...starts) + 1.2;
  const left = 34, bottom = height - 26;
  const x = time => left + (time - from) / (to - from) * (width - left - 8);
  const gap = (bottom - 40) / row.length;
  context.font = "12px system-ui";
  context.fillStyle = context.strokeStyle = getComputedStyle(document.body).color;
  const step = [0.5, 1, 2, 5, 10].find(step => (to - from) / step < 9) ?? 20;
  for (let tick = Math.ceil(from / step) * step; tick < to; tick += step) {
    context.globalAlpha = 0.2;
    context.fillRect(x(tick), 8, 1, bottom - 8);
    context.globalAlpha = 1;
    context.fillText(tick.toFixed(1), x(tick) - 8, height - 10);
  }
  context.fillText("ms", width - 18, height - 10);
  row.forEach((strike, place) => {
    const base = bottom - 6 - gap * (row.length - 1 - place);
    context.globalAlpha = 1;
    context.fillText(strike.bead, 8, base + 4);
    context.beginPath();
    let begun = false;
    strike.curves.force_n.forEach((force, scan) => {
      const time = starts[place] + strike.curves.from_ms + strike.curves.step_ms * scan;
      if (time < from || time > to) return;
      context[begun ? "lineTo" : "moveTo"](x(time), base - force / peak * Math.min(60, 2 * gap));
      begun = true;
    });
    context.lineWidth = 1.5;
    context.strokeStyle = "#1f77b4";
    context.stroke();
  });
  element("row-note").textContent = "ms after bead " + first.bead + " was struck; the highest is " + peak.toFixed(3) + " N";
}

function take(message) {
  if (message.type === "state") {
    state.beads = message.beads;
    element("summary").textContent = message.strikes + " strikes, " + (message.bytes_per_s / 1000).toFixed(1) + " kB/s, "
      + message.recording;
    element("download").hidden = !message.can_download;
    element("messages").textContent = message.messages.slice(-20).reverse().join("\n");
    element("left-out").textContent = message.left_out
      ? message.left_out + " strikes went by while this page was slow; the recording has them" : "";
    if (state.chosen === null && state.beads.length) choose(state.beads[0].bead);
    drawBeads();
  } else if (message.type === "strikes") {
    const known = new Set(state.strikes.map(strike => strike.serial));
    state.strikes.push(...message.strikes.filter(strike => !known.has(strike.serial)));
    state.strikes.splice(0, Math.max(0, state.strikes.length - STRIKES_MOST));
    for (const strike of message.strikes) if (strike.curves) state.last.set(strike.bead, strike);
    drawList();
    drawStrike();
    drawRow();
  }
  document.body.dataset.strikes = state.strikes.length;
}

function connect() {
  const address = new URL("live", location.href);
  address.protocol = "ws:";
  const socket = new WebSocket(address);
  socket.onopen = () => { state.strikes = []; };
  socket.onmessage = event => take(JSON.parse(event.data));
  socket.onclose = () => {
    element("summary").textContent = "the monitor does not answer; trying again";
    setTimeout(connect, 1000);
  };
}

new ResizeObserver(() => {
  const width = element("curves").clientWidth / 3 - 8;
  for (const plot of state.plots ?? []) plot.setSize({ width, height: 220 });
}).observe(element("curves"));
connect();
