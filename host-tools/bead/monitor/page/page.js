// The page of `bead monitor --web`. All that comes from a bead is put in as text, never as markup.
"use strict";

const KEPT = 200; // strikes
const TOGETHER_MS = 500; // between the receipts of one wave at two beads, at most
const WAVE_S = 0.02; // from the first bead of a row to its last, at most: some 80 beads
const at = (id) => document.getElementById(id);
const strikes = []; // the newest first
let chosen = null; // serial number of a strike that was clicked; null for the newest
let state = null;

const withU = (value, u) => {
  if (!(u > 0)) return value.toFixed(3);
  const digits = Math.min(6, Math.max(0, 2 - Math.floor(Math.log10(2 * u))));
  return `${value.toFixed(digits)} ± ${(2 * u).toFixed(digits)}`;
};
const cell = (row, text, isWarning) => {
  const made = row.insertCell();
  made.textContent = text;
  if (isWarning) made.className = "warning";
};
const emptied = (id) => {
  const body = at(id).tBodies[0];
  body.replaceChildren();
  return body;
};

function drawBeads() {
  const body = emptied("beads");
  for (const bead of state.beads) {
    const row = body.insertRow();
    const armed = bead.armed === null ? "-" : bead.armed ? "armed" : "disarmed";
    const health = bead.standing.length ? bead.standing.join(", ") : bead.last_fault;
    const losses = bead.losses.map((loss) => `${loss.count} ${loss.cause}`).join(", ");
    cell(row, `${bead.bead} at ${bead.port}`);
    cell(row, bead.silent_s === null ? armed : `silent for ${bead.silent_s} s`, bead.silent_s !== null);
    cell(row, bead.strikes);
    cell(row, bead.frames);
    cell(row, bead.supply_v === null ? "-" : `${bead.supply_v.toFixed(3)} V`);
    cell(row, bead.clock_ppm === null ? "-"
      : `${bead.clock_ppm[0].toFixed(1)} ± ${bead.clock_ppm[1].toFixed(1)} ppm`);
    cell(row, health ?? "good", health !== null);
    cell(row, losses || "none", losses !== "");
  }
  at("recording").textContent = state.recording;
  at("rate").textContent = `${(state.bytes_per_s / 1000).toFixed(1)} kB/s, ${state.strikes} strikes`;
  at("messages").textContent = state.messages.join("\n");
}

const plots = {};
function plot(id, label, colour, times, values) {
  const width = at(id).clientWidth;
  if (!plots[id]) {
    const options = {
      width, height: 220, title: label, legend: { show: false }, cursor: { drag: { x: true, y: false } },
      scales: { x: { time: false } },
      axes: [{ label: "ms from the trigger", labelSize: 20, size: 34 }, { size: 60 }],
      series: [{}, { stroke: colour, width: 1.2 }],
    };
    plots[id] = new uPlot(options, [times, values], at(id));
  }
  plots[id].setSize({ width, height: 220 });
  plots[id].setData([times, values]);
}

function shown() {
  return strikes.find((one) => one.strike.serial === chosen) ?? strikes[0];
}

function drawStrike() {
  const one = shown();
  if (!one) return;
  const { strike, curves } = one;
  const time = strike.at_s === null ? "" : ` at ${strike.at_s.toFixed(5)} s`;
  at("title").textContent = `Strike ${strike.strike} of bead ${strike.bead}${time}${strike.fetched ? ", fetched" : ""}`;
  const residual = strike.residual === null ? "" : ` · residual ${(100 * strike.residual).toFixed(1)} %`;
  const missing = strike.missing ? ` · ${strike.missing} samples missing` : "";
  at("values").textContent =
    `A ${withU(strike.absorbed_measured_nj, strike.absorbed_measured_u)} nJ · ` +
    `B ${withU(strike.absorbed_predicted_nj, strike.absorbed_predicted_u)} nJ · ` +
    `peak ${withU(strike.peak_force_n, strike.peak_force_u)} N · ` +
    `${strike.acceleration[0].toFixed(1)} to ${strike.acceleration[1].toFixed(1)} m/s²${residual}${missing} · ` +
    `${strike.flags.join(", ") || "no flags"} · ±: two standard uncertainties`;
  at("curves").hidden = !curves;
  if (!curves) return;
  const times = curves.force_n.map((_, place) => curves.from_ms + place * curves.step_ms);
  plot("force", "force, N", "#15803d", times, curves.force_n);
  plot("acceleration", "acceleration of the intruder, m/s²", "#7e22ce", times, curves.acceleration);
  plot("residual", "measured less predicted, m/s²", "#b45309",
    times.slice(0, curves.residual.length), curves.residual);
}

function drawList() {
  const body = emptied("strikes");
  const now = shown();
  for (const one of strikes) {
    const { strike } = one;
    const row = body.insertRow();
    if (one === now) row.className = "chosen";
    row.onclick = () => {
      chosen = strike === strikes[0].strike ? null : strike.serial;
      draw();
    };
    cell(row, strike.bead);
    cell(row, strike.strike);
    cell(row, strike.at_s === null ? "-" : strike.at_s.toFixed(5));
    cell(row, strike.peak_force_n.toFixed(4));
    cell(row, withU(strike.absorbed_measured_nj, strike.absorbed_measured_u));
    cell(row, withU(strike.absorbed_predicted_nj, strike.absorbed_predicted_u));
    cell(row, strike.flags.join(", "), strike.flags.length > 0);
  }
}

// The strikes of one wave, one a bead, each with the time of its trigger on a time that all share, in ms.
function wave() {
  const first = shown();
  if (!first) return { beads: [], isShared: false };
  const apart = (one) => Math.abs(one.strike.received_ms - first.strike.received_ms);
  const near = strikes.filter((one) => one.curves && apart(one) < TOGETHER_MS);
  const isShared = near.every(({ strike }) => strike.since_edge_s) && new Set(near.map(({ strike }) => strike.bead)).size > 1;
  // Time of a strike after the first one, s. Both count from the last edge, and one may come between them.
  const after = ({ strike }) => {
    const [since, period] = strike.since_edge_s;
    const later = since - first.strike.since_edge_s[0];
    return later - period * Math.round(later / period);
  };
  const far = (one) => (one === first ? -1 : isShared ? Math.abs(after(one)) : apart(one));
  const nearest = new Map();
  for (const one of near) {
    const other = nearest.get(one.strike.bead);
    if (!other || far(one) < far(other)) nearest.set(one.strike.bead, one);
  }
  // Until all beads have sent the newest wave, some still have the one before.
  const ofWave = [...nearest.values()].filter((one) => !isShared || Math.abs(after(one)) < WAVE_S);
  const earliest = isShared ? Math.min(...ofWave.map(after)) : 0;
  const beads = ofWave.map((one) => ({ ...one, from: isShared ? 1000 * (after(one) - earliest) : 0 }));
  beads.sort((a, b) => a.strike.bead - b.strike.bead);
  return { beads, isShared };
}

function drawRow() {
  const canvas = at("row");
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const scale = window.devicePixelRatio || 1;
  canvas.width = width * scale;
  canvas.height = height * scale;
  const pen = canvas.getContext("2d");
  pen.scale(scale, scale);
  pen.font = "12px system-ui, sans-serif";
  const { beads, isShared } = wave();
  if (!beads.length) return;
  const [left, bottom, top] = [60, 28, 12];
  const firsts = beads.map(({ from, curves }) => from + curves.from_ms);
  const lasts = beads.map(({ from, curves }) => from + curves.from_ms + curves.step_ms * curves.force_n.length);
  const [begin, end] = [Math.min(...firsts), Math.max(...lasts)];
  const highest = Math.max(...beads.flatMap(({ curves }) => curves.force_n), 1e-6);
  const step = (height - bottom - top) / beads.length;
  const x = (time) => left + ((time - begin) / (end - begin)) * (width - left - 10);
  beads.forEach(({ strike, curves, from }, place) => {
    const zero = height - bottom - 4 - place * step;
    pen.fillStyle = "#5a6675";
    pen.fillText(`bead ${strike.bead}`, 4, zero);
    pen.strokeStyle = "#d9dde3";
    pen.beginPath();
    pen.moveTo(left, zero);
    pen.lineTo(width - 10, zero);
    pen.stroke();
    pen.strokeStyle = "#15803d";
    pen.beginPath();
    curves.force_n.forEach((force, sample) => {
      const [across, up] = [x(from + curves.from_ms + sample * curves.step_ms), zero - (force / highest) * step * 0.9];
      if (sample === 0) pen.moveTo(across, up); else pen.lineTo(across, up);
    });
    pen.stroke();
  });
  pen.fillStyle = "#5a6675";
  for (let tick = Math.ceil(begin); tick <= end; tick += Math.max(1, Math.round((end - begin) / 8))) {
    pen.fillText(`${tick}`, x(tick) - 4, height - 8);
  }
  pen.fillText("ms", width - 22, height - 8);
  at("base").textContent = `tallest: ${highest.toFixed(3)} N; ` + (isShared
    ? "all beads on one time axis, aligned by the edges at their sync inputs"
    : "each bead from its own trigger: without edges at their sync inputs, the beads share no time");
}

function draw() {
  drawStrike();
  drawList();
  drawRow();
}

function connect() {
  const socket = new WebSocket(new URL("live", location.href.replace(/^http/, "ws")));
  socket.onopen = () => {
    at("connection").textContent = "live";
    at("connection").className = "";
  };
  socket.onmessage = ({ data }) => {
    const news = JSON.parse(data);
    state = news.state;
    // A monitor that was started anew counts from 1 again.
    if (strikes.length && strikes[0].strike.serial > state.newest) strikes.length = 0;
    const known = new Set(strikes.map(({ strike }) => strike.serial));
    const fresh = news.strikes.filter(({ strike }) => !known.has(strike.serial));
    strikes.unshift(...fresh.reverse());
    strikes.length = Math.min(strikes.length, KEPT);
    at("missed").textContent = news.missed
      ? `${news.missed} strikes were not shown here, as this browser was too slow; the recording has them` : "";
    drawBeads();
    if (fresh.length) draw();
  };
  socket.onclose = () => {
    at("connection").textContent = "connection lost; trying again";
    at("connection").className = "warning";
    setTimeout(connect, 1000);
  };
}

window.addEventListener("resize", draw);
connect();
