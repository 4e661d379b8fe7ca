"use strict";
// ---- the numbers: base64 of little-endian arrays, (theta_i, detector, wavelength) with the last one fastest
const DATA = JSON.parse(document.getElementById("data").textContent);
const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));
const floats = text => text ? new Float32Array(bytes(text).buffer) : null;
const RESULTS = DATA.results.map(r => ({
  ...r, brdf: floats(r.brdf), error: floats(r.error), rgb: floats(r.rgb), cells: floats(r.cells),
  bounces: r.bounces && {...r.bounces, shares: bytes(r.bounces.shares)}, shown: true,
}));
const CIVIDIS = bytes(DATA.cividis);
const UNKNOWN = 255;
const $ = id => document.getElementById(id);

const union = key => [...new Set(RESULTS.flatMap(r => r[key].map(x => +x.toFixed(6))))].sort((a, b) => a - b);
const GRID = {ti: union("theta_i"), nm: union("wavelength"), to: union("theta_o")};
const nearest = (list, x) => list.reduce((best, y, i) => Math.abs(y - x) < Math.abs(list[best] - x) ? i : best, 0);
const reach = list => list.length > 1 ? (list[list.length - 1] - list[0]) / (list.length - 1) / 2 : 0.5;

// index of the value of a result that stands for x, or -1 where the result has none near it
function found(list, x, least) {
  const i = nearest(list, x);
  return Math.abs(list[i] - x) <= Math.max(least, reach(list)) + 1e-6 ? i : -1;
}
const at = (r, i, o, l) => (i * r.detectors + o) * r.wavelength.length + l;

// ---- what is shown, kept in the address
const state = {ti: nearest(GRID.ti, 40), nm: nearest(GRID.nm, 550), to: 0, log: true, relative: false,
  exposure: 0, chromatic: false, quantity: "brdf"};
state.to = nearest(GRID.to, -GRID.ti[state.ti]);
const value = key => GRID[key][state[key]];

function readAddress() {
  for (const [key, text] of new URLSearchParams(location.hash.slice(1))) {
    if (key in GRID && Number.isFinite(+text)) state[key] = nearest(GRID[key], +text);
    else if (typeof state[key] === "boolean") state[key] = text === "1";
    else if (key === "exposure" && Number.isFinite(+text)) state.exposure = Math.min(5, Math.max(-3, +text));
    else if (key === "quantity" && ["brdf", "rgb", "bounces"].includes(text)) state.quantity = text;
    else if (key === "hide") RESULTS.forEach(r => { r.shown = !text.split(",").includes(r.name); });
  }
}
function writeAddress() {
  const p = new URLSearchParams({ti: value("ti"), nm: value("nm"), to: value("to"), log: +state.log});
  if (state.relative) p.set("relative", 1);
  if (state.exposure) p.set("exposure", state.exposure);
  if (state.chromatic) p.set("chromatic", 1);
  if (state.quantity !== "brdf") p.set("quantity", state.quantity);
  const hidden = RESULTS.filter(r => !r.shown).map(r => r.name);
  if (hidden.length) p.set("hide", hidden.join(","));
  try { history.replaceState(null, "", "#" + p); } catch { /* a viewer that keeps no address */ }
}

// ---- drawing
const shown = () => RESULTS.filter(r => r.shown);
const minus = text => String(text).replace("-", "−");
const safe = text => String(text).replace(/[&<>"]/g, c => `&#${c.charCodeAt(0)};`);
const number = x => !Number.isFinite(x) ? "–" : x === 0 ? "0" : minus(Math.abs(x) < 1e-3 || Math.abs(x) >= 1e5 ? x.toExponential(3).replace("e", "·10^").replace(/\^[+]?(-?\d+)/, (_, n) => power(n).slice(2)) : x.toPrecision(4));
const short = v => v && Math.abs(v) < 1e-3 ? number(v) : minus(+v.toPrecision(6));  // of round numbers on axes
const line = points => points.length ? "M" + points.map(p => p.map(x => x.toFixed(1)).join(" ")).join("L") : "";
const svg = (w, h, label, body) => `<svg viewBox="0 0 ${w} ${h}" role="img" aria-label="${safe(label)}">${body}</svg>`;
const text = (x, y, words, anchor = "middle", kind = "") => `<text x="${x.toFixed(1)}" y="${y.toFixed(1)}" text-anchor="${anchor}" class="${kind}">${words}</text>`;
const stroke = (d, colour, more = "") => `<path d="${d}" fill="none" stroke="${colour}" ${more}/>`;
const theta = letter => `<tspan font-style="italic">θ</tspan><tspan dy="3" font-size="9">${letter}</tspan><tspan dy="-3">\u200b</tspan>`;
const INK = "#1a2230", MUTED = "#5c6675", GRIDLINE = "#d9dee5";

// runs of consecutive points that hold a value
function runs(points) {
  const all = [[]];
  for (const p of points) if (p) all[all.length - 1].push(p); else if (all[all.length - 1].length) all.push([]);
  return all.filter(run => run.length);
}
function steps(top) {  // round values for about four grid lines
  const raw = top / 4, power = 10 ** Math.floor(Math.log10(raw)), d = [1, 2, 5, 10].find(s => s * power >= raw) * power;
  return Array.from({length: Math.floor(top / d + 1e-9)}, (_, i) => +((i + 1) * d).toPrecision(6));
}
const power = n => "10" + String(n).replace(/./g, c => ({"-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³"}[c] || String.fromCharCode(0x2070 + +c)));

function drawLobe() {
  const W = 520, H = 296, cx = 260, cy = 262, R = 218, turn = Math.PI / 180;
  let top = 0;
  for (const r of shown()) {
    const i = found(r.theta_i, value("ti"), 0.5);
    if (i >= 0) for (const o of r.index) for (let l = 0; l < r.wavelength.length; l++) top = Math.max(top, r.brdf[at(r, i, o, l)] || 0);
  }
  top = top || 1;
  const high = Math.ceil(Math.log10(top) - 1e-9), decades = 4;
  const radius = f => R * (state.log ? Math.max(0, Math.min(1, 1 + (Math.log10(f) - high) / decades)) : Math.max(0, f) / (top * 1.03));
  const place = (t, d) => [cx + d * Math.sin(t * turn), cy - d * Math.cos(t * turn)];
  let body = "";
  const rings = state.log ? [0, 1, 2, 3].map(k => [high - k, power(high - k)]).map(([n, w]) => [10 ** n, w]) : steps(top).map(v => [v, short(v)]);
  for (const [v, words] of rings) {
    const d = radius(v);
    body += stroke(`M${cx - d} ${cy}A${d} ${d} 0 0 1 ${cx + d} ${cy}`, GRIDLINE) + text(cx + d, cy + 15, words, "middle", "mute");
  }
  for (let t = -90; t <= 90; t += 30) {
    body += stroke(line([[cx, cy], place(t, R)]), GRIDLINE);
    if (Math.abs(t) < 90) body += text(...place(t, R + 13).map((x, k) => x + 4 * k), minus(t) + "°", "middle", "mute");
  }
  body += text(cx, cy + 30, state.log ? "BRDF (sr⁻¹), logarithmic over four decades" : "BRDF (sr⁻¹), linear", "middle", "mute");
  const ti = value("ti");
  body += stroke(line([[cx, cy], place(-ti, R)]), MUTED, 'stroke-dasharray="5 4"');
  const tip = place(ti, R * 0.72), end = place(ti, R);
  const a = ti * turn, head = [[-5, -11], [5, -11]].map(([u, v]) => [tip[0] + u * Math.cos(a) - v * Math.sin(a), tip[1] + u * Math.sin(a) + v * Math.cos(a)]);
  body += stroke(line([end, tip]), INK, 'stroke-width="1.6"') + `<path d="${line([tip, ...head])}Z" fill="${INK}"/>`;
  for (const r of shown()) {
    const i = found(r.theta_i, ti, 0.5), l = found(r.wavelength, value("nm"), 0.5);
    if (i < 0 || l < 0) continue;
    const values = r.index.map(o => r.brdf[at(r, i, o, l)]);
    const points = values.map((f, k) => f > 0 ? place(r.theta_o[k], radius(f)) : null);
    if (r.error) {
      const band = sign => r.theta_o.map((t, k) => points[k] ? place(t, radius(Math.max(values[k] + sign * (r.error[at(r, i, r.index[k], l)] || 0), 1e-30))) : null);
      const outer = runs(band(1)), inner = runs(band(-1));
      outer.forEach((run, k) => { body += `<path d="${line([...run, ...inner[k].slice().reverse()])}Z" fill="${r.colour}" opacity="0.18"/>`; });
    }
    for (const run of runs(points)) body += stroke(line(run), r.colour, 'stroke-width="2" class="curve"');
    if (r.name === "measured") for (const p of points) if (p) body += `<circle cx="${p[0].toFixed(1)}" cy="${p[1].toFixed(1)}" r="2.4" fill="#fff" stroke="${r.colour}"/>`;
  }
  const dot = place(value("to"), R);
  body += stroke(line([[cx, cy], dot]), "#a4262c", 'stroke-width="1.2"') + `<circle cx="${dot[0]}" cy="${dot[1]}" r="4" fill="#a4262c"/>`;
  $("lobe").innerHTML = svg(W, H, `Polar lobe at ${value("ti")}° and ${value("nm")} nm`, body);
}

function spectrumOf(r) {
  const i = found(r.theta_i, value("ti"), 0.5), k = found(r.theta_o, value("to"), 0.5);
  if (i < 0 || k < 0) return null;
  const each = r.wavelength.map((w, l) => {
    const place = at(r, i, r.index[k], l);
    return {w, f: r.brdf[place], e: r.error ? r.error[place] : NaN};
  }).filter(p => Number.isFinite(p.f));
  const mean = each.reduce((s, p) => s + p.f, 0) / (each.length || 1);
  const scale = state.relative ? mean : 1;
  return scale > 0 || !state.relative ? each.map(p => ({w: p.w, f: p.f / scale, e: p.e / scale})) : null;
}

function drawSpectra() {
  const W = 520, H = 270, x0 = 52, x1 = 506, y0 = 228, y1 = 14;
  const curves = shown().map(r => [r, spectrumOf(r)]).filter(([, s]) => s && s.length);
  const top = Math.max(...curves.flatMap(([, s]) => s.map(p => Math.max(p.f, Math.min(p.f + (p.e || 0), 1.5 * p.f)))), 0) * 1.06 || 1;
  const low = GRID.nm[0], high = GRID.nm[GRID.nm.length - 1], wide = high - low || 1;
  const x = w => x0 + (x1 - x0) * (high > low ? (w - low) / wide : 0.5), y = f => y0 - (y0 - y1) * Math.max(0, Math.min(f / top, 1.02));
  let body = "";
  for (const v of [0, ...steps(top)]) body += stroke(line([[x0, y(v)], [x1, y(v)]]), GRIDLINE) + text(x0 - 6, y(v) + 4, short(v), "end", "mute");
  const spacing = [20, 50, 100, 200, 500].find(s => wide / s <= 9) || wide;
  for (let w = Math.ceil(low / spacing) * spacing; w <= high; w += spacing) body += text(x(w), y0 + 17, w, "middle", "mute");
  body += text((x0 + x1) / 2, y0 + 35, "wavelength λ (nm)", "middle", "mute") + text(x0, 9, state.relative ? "BRDF over its mean" : "BRDF (sr⁻¹)", "start", "mute");
  body += stroke(line([[x(value("nm")), y0], [x(value("nm")), y1]]), "#a4262c", 'stroke-width="1.2"');
  for (const [r, s] of curves) {
    if (r.error) body += `<path d="${line([...s.map(p => [x(p.w), y(p.f + (p.e || 0))]), ...s.slice().reverse().map(p => [x(p.w), y(p.f - (p.e || 0))])])}Z" fill="${r.colour}" opacity="0.18"/>`;
    body += stroke(line(s.map(p => [x(p.w), y(p.f)])), r.colour, 'stroke-width="2" class="curve"');
    if (r.name === "measured" || s.length === 1) for (const p of s) body += `<circle cx="${x(p.w).toFixed(1)}" cy="${y(p.f).toFixed(1)}" r="2.6" fill="#fff" stroke="${r.colour}"/>`;
  }
  if (!curves.length) body += text((x0 + x1) / 2, 120, "no value in this direction", "middle", "mute");
  $("spectra").innerHTML = svg(W, H, `Spectra at ${value("to")}°`, body);
}

function drawValues() {
  $("values").innerHTML = shown().map(r => {
    const i = found(r.theta_i, value("ti"), 0.5), k = found(r.theta_o, value("to"), 0.5), l = found(r.wavelength, value("nm"), 0.5);
    const place = i < 0 || k < 0 || l < 0 ? -1 : at(r, i, r.index[k], l);
    const share = r.bounces && place >= 0 ? r.bounces.shares[place] : UNKNOWN;
    const there = place < 0 ? "" : [[r.theta_i[i], "ti", "θᵢ"], [r.theta_o[k], "to", "θₒ"], [r.wavelength[l], "nm", "λ"]]
      .filter(([v, key]) => Math.abs(v - value(key)) > 0.05).map(([v, , letter]) => `${letter} ${minus(+v.toFixed(1))}`).join(", ");
    const cell = words => `<td class="n">${words}</td>`;
    return `<tr><th scope="row"><span class="swatch" style="background:${r.colour}"></span>${safe(r.title)}${there ? ` <small>(at ${there})</small>` : ""}</th>` +
      cell(place < 0 ? "–" : number(r.brdf[place])) + cell(place < 0 || !r.error ? "–" : number(r.error[place])) +
      cell(share === UNKNOWN ? "–" : `${(share / 2.54).toFixed(1)} %`) + "</tr>";
  }).join("");
}

function borders(list) {
  if (list.length === 1) return [list[0] - 5, list[0] + 5];
  const middle = list.slice(1).map((v, i) => (v + list[i]) / 2);
  return [2 * list[0] - middle[0], ...middle, 2 * list[list.length - 1] - middle[middle.length - 1]].map(v => Math.max(-90, Math.min(90, v)));
}

function drawBounces() {
  if (!$("bounces")) return;
  const W = 520, H = 250, x0 = 46, x1 = 506, y0 = 200, y1 = 30;
  const x = t => x0 + (x1 - x0) * (t + 90) / 180, y = s => y0 - (y0 - y1) * s;
  $("bounces").innerHTML = shown().filter(r => r.bounces).map(r => {
    const i = found(r.theta_i, value("ti"), 0.5), l = found(r.wavelength, value("nm"), 0.5), edge = borders(r.theta_o);
    let body = "", size = r.brdf.length;
    if (i >= 0 && l >= 0) r.index.forEach((o, k) => {
      const place = at(r, i, o, l), left = x(edge[k]).toFixed(1), wide = (x(edge[k + 1]) - x(edge[k]) + 0.3).toFixed(1);
      const parts = r.bounces.names.map((_, b) => r.bounces.shares[b * size + place]);
      if (parts[0] === UNKNOWN) { body += `<rect x="${left}" y="${y1}" width="${wide}" height="${y0 - y1}" fill="#eceff2"/>`; return; }
      const sum = parts.reduce((s, p) => s + p, 0) || 1;
      let below = 0;
      parts.forEach((p, b) => {
        if (p) body += `<rect x="${left}" y="${y((below + p) / sum).toFixed(1)}" width="${wide}" height="${((y0 - y1) * p / sum).toFixed(1)}" fill="${r.bounces.colours[b]}"/>`;
        below += p;
      });
    });
    for (const s of [0, 0.5, 1]) body += text(x0 - 6, y(s) + 4, `${100 * s} %`, "end", "mute");
    for (let t = -60; t <= 60; t += 30) body += text(x(t), y0 + 17, minus(t) + "°", "middle", "mute");
    body += stroke(line([[x(-value("ti")), y0], [x(-value("ti")), y1]]), MUTED, 'stroke-dasharray="5 4"');
    body += stroke(line([[x(value("to")), y0], [x(value("to")), y1 - 4]]), "#a4262c", 'stroke-width="1.4"');
    body += text((x0 + x1) / 2, y0 + 36, `angle of reflection ${theta("o")}`, "middle", "mute");
    const room = (x1 - x0) / r.bounces.names.length;
    r.bounces.names.forEach((n, b) => { body += `<rect x="${x0 + room * b}" y="6" width="11" height="11" fill="${r.bounces.colours[b]}"/>` + text(x0 + 15 + room * b, 16, n, "start"); });
    return `<div><h3>${safe(r.title)}</h3>${svg(W, H, "Shares by number of reflections", body)}</div>`;
  }).join("");
}

// ---- colour
const gamma = v => Math.round(255 * (v <= 0.0031308 ? 12.92 * Math.max(v, 0) : 1.055 * Math.min(v, 1) ** (1 / 2.4) - 0.055));
function colourOf(r, place, exposure) {
  const [red, green, blue] = [0, 1, 2].map(c => r.rgb[3 * place + c]);
  if (!Number.isFinite(red + green + blue)) return null;
  const luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
  if (state.chromatic && !(luminance > 0)) return null;
  const factor = state.chromatic ? 0.5 / luminance : exposure;
  return `rgb(${[red, green, blue].map(v => gamma(v * factor)).join(" ")})`;
}
const exposure = () => Math.min(...RESULTS.filter(r => r.rgb).map(r => r.exposure)) * 2 ** state.exposure;

const MAP = {W: 360, H: 246, x0: 34, x1: 354, y0: 206, y1: 6};
const mapX = t => MAP.x0 + (MAP.x1 - MAP.x0) * (t + 90) / 180;
function mapY(r) {
  const edge = borders(r.theta_i), low = edge[0], high = edge[edge.length - 1];
  return t => MAP.y0 - (MAP.y0 - MAP.y1) * (t - low) / (high - low || 1);
}
function drawMaps() {
  $("maps").innerHTML = shown().map(r => {
    if (!r.rgb) return `<div><h3>${safe(r.title)}</h3><p>No colours: ${safe(r.no_rgb)}.</p></div>`;
    const across = borders(r.theta_o), up = borders(r.theta_i), y = mapY(r);
    let body = "";
    r.theta_i.forEach((t, i) => r.index.forEach((o, k) => {
      const colour = colourOf(r, i * r.detectors + o, exposure());
      const left = mapX(across[k]), high = y(up[i + 1]), gap = r.index.length > 90 ? 0 : 0.7;
      body += `<rect x="${left.toFixed(1)}" y="${high.toFixed(1)}" width="${(mapX(across[k + 1]) - left - gap).toFixed(1)}" height="${(y(up[i]) - high - gap).toFixed(1)}" fill="${colour || "#f1f3f5"}"/>`;
    }));
    for (let t = -60; t <= 60; t += 30) body += text(mapX(t), MAP.y0 + 17, minus(t) + "°", "middle", "mute");
    const every = Math.ceil(r.theta_i.length / 9);
    r.theta_i.forEach((t, i) => { if (i % every === 0) body += text(MAP.x0 - 6, y(t) + 4, minus(+t.toFixed(1)) + "°", "end", "mute"); });
    body += text((MAP.x0 + MAP.x1) / 2, MAP.y0 + 34, `across ${theta("o")}, upwards ${theta("i")}`, "middle", "mute");
    return `<div><h3>${safe(r.title)}</h3><div data-result="${RESULTS.indexOf(r)}">${svg(MAP.W, MAP.H, "Colours over the angles of reflection and incidence", body + '<rect class="chosen" fill="none" stroke="#a4262c" stroke-width="2.5"/>')}</div></div>`;
  }).join("");
  $("exposure-out").textContent = state.chromatic ? "" : `× ${number(exposure())}`;
  $("exposure").disabled = state.chromatic;
}
function drawChosen() {
  for (const holder of document.querySelectorAll("[data-result]")) {
    const r = RESULTS[holder.dataset.result], box = holder.querySelector(".chosen");
    const i = found(r.theta_i, value("ti"), 0.5), k = found(r.theta_o, value("to"), 0.5);
    box.setAttribute("visibility", i < 0 || k < 0 ? "hidden" : "visible");
    if (i < 0 || k < 0) continue;
    const across = borders(r.theta_o), up = borders(r.theta_i), y = mapY(r);
    const place = {x: mapX(across[k]) - 1, y: y(up[i + 1]) - 1, width: mapX(across[k + 1]) - mapX(across[k]) + 1, height: y(up[i]) - y(up[i + 1]) + 1};
    for (const [name, v] of Object.entries(place)) box.setAttribute(name, v.toFixed(1));
  }
}

function drawSphere() {
  if (!$("sphere")) return;
  const list = shown().filter(r => r.cells), S = 840, half = S / 2, R = half - 34, turn = Math.PI / 180;
  $("sphere").innerHTML = list.map((r, n) => `<div><h3>${safe(r.title)}</h3><canvas id="cells${n}" width="${S}" height="${S}" role="img" aria-label="Hemisphere of ${safe(r.title)}"></canvas><p id="scale${n}"></p></div>`).join("");
  const places = list.map(r => [found(r.theta_i, value("ti"), 0.5), found(r.wavelength, value("nm"), 0.5)]);
  let top = 0;
  list.forEach((r, n) => { if (Math.min(...places[n]) >= 0) for (let c = 0; c < r.detectors; c++) top = Math.max(top, r.brdf[at(r, places[n][0], c, places[n][1])] || 0); });
  list.forEach((r, n) => {
    const g = $(`cells${n}`).getContext("2d"), [i, l] = places[n];
    const scale = v => { const s = 3 * Math.round(255 * Math.max(0, Math.min(1, v))); return `rgb(${CIVIDIS[s]} ${CIVIDIS[s + 1]} ${CIVIDIS[s + 2]})`; };
    const colour = c => {
      const place = at(r, i, c, l);
      if (state.quantity === "rgb") return r.rgb && colourOf(r, i * r.detectors + c, exposure());
      if (state.quantity === "bounces") return r.bounces && r.bounces.shares[place] !== UNKNOWN ? scale(1 - r.bounces.shares[place] / 254) : null;
      return Number.isFinite(r.brdf[place]) ? scale(r.brdf[place] > 0 ? 1 + Math.log10(r.brdf[place] / top) / 3 : 0) : null;
    };
    const note = {brdf: `from ${number(top / 1000)} (dark) to ${number(top)} sr⁻¹ (light)`, rgb: r.no_rgb || `exposure × ${number(exposure())}`,
      bounces: r.bounces ? "from 0 (dark) to 100 % (light); pale: too few rays" : "this result is not split by reflections"}[state.quantity];
    $(`scale${n}`).textContent = i < 0 || l < 0 ? "This result has no value at this angle and wavelength." : note;
    if (i >= 0 && l >= 0) for (let c = 0; c < r.detectors; c++) {
      const [from, to, start, stop] = r.cells.subarray(4 * c, 4 * c + 4);
      g.beginPath();
      g.arc(half, half, R * to / 90, -stop * turn, -start * turn);
      g.arc(half, half, R * from / 90, -start * turn, -stop * turn, true);
      g.closePath();
      g.fillStyle = g.strokeStyle = colour(c) || "#e3e7ec";
      g.fill(); g.stroke();
    }
    g.strokeStyle = "rgb(255 255 255 / .7)"; g.lineWidth = 1.5;
    for (const t of [30, 60]) { g.beginPath(); g.arc(half, half, R * t / 90, 0, 7); g.stroke(); }
    g.fillStyle = INK; g.font = "24px sans-serif"; g.textAlign = "center"; g.fillText("90°", half, S - 6);
    const d = R * value("ti") / 90, p = [Math.cos(r.phi_i * turn) * d, -Math.sin(r.phi_i * turn) * d];
    for (const [width, ink] of [[7, "#fff"], [3, INK]]) {
      g.lineWidth = width; g.strokeStyle = ink; g.beginPath(); g.arc(half + p[0], half + p[1], 12, 0, 7); g.stroke();
      g.beginPath();
      for (const s of [-1, 1]) { g.moveTo(half - p[0] - 11, half - p[1] - 11 * s); g.lineTo(half - p[0] + 11, half - p[1] + 11 * s); }
      g.stroke();
    }
  });
}

// ---- controls
function labels() {
  const unit = {ti: "°", nm: " nm", to: "°"};
  for (const key of Object.keys(GRID)) {
    const words = minus(+value(key).toFixed(2)) + unit[key];
    $(key).max = GRID[key].length - 1; $(key).value = state[key]; $(key).disabled = GRID[key].length === 1;
    $(key).setAttribute("aria-valuetext", words); $(`${key}-out`).textContent = words;
  }
  for (const key of ["log", "relative", "chromatic"]) $(key).checked = state[key];
  $("exposure").value = state.exposure;
  if ($("quantity")) $("quantity").value = state.quantity;
}
function draw(mapsToo) {
  labels(); drawLobe(); drawSpectra(); drawValues(); drawBounces();
  if (mapsToo) drawMaps();
  drawChosen(); drawSphere(); writeAddress();
}
let waiting = false, maps = false;
function change(key, x, mapsToo = false) {
  state[key] = x; maps = maps || mapsToo;
  if (waiting) return;  // one drawing for all that changes before the next picture
  waiting = true;
  requestAnimationFrame(() => { waiting = false; draw(maps); maps = false; });
}
for (const key of Object.keys(GRID)) $(key).addEventListener("input", e => change(key, +e.target.value));
for (const key of ["log", "relative"]) $(key).addEventListener("change", e => change(key, e.target.checked));
$("chromatic").addEventListener("change", e => change("chromatic", e.target.checked, true));
$("exposure").addEventListener("input", e => change("exposure", +e.target.value, true));
if ($("quantity")) $("quantity").addEventListener("change", e => change("quantity", e.target.value));
$("mirror").addEventListener("click", () => change("to", nearest(GRID.to, -value("ti"))));
$("back").addEventListener("click", () => change("to", nearest(GRID.to, value("ti"))));
$("maps").addEventListener("click", e => {
  const holder = e.target.closest("[data-result]");
  if (!holder) return;
  const r = RESULTS[holder.dataset.result], box = holder.firstElementChild.getBoundingClientRect(), scale = MAP.W / box.width;
  const x = (e.clientX - box.left) * scale, y = (e.clientY - box.top) * scale, height = mapY(r);
  change("ti", nearest(GRID.ti, r.theta_i[nearest(r.theta_i.map(height), y)]));
  change("to", nearest(GRID.to, r.theta_o[nearest(r.theta_o.map(mapX), x)]));
});
readAddress();
$("shown").innerHTML = RESULTS.map((r, n) => `<label><input type="checkbox" data-show="${n}" ${r.shown ? "checked" : ""}><span class="swatch" style="background:${r.colour}"></span>${safe(r.title)}</label> `).join("");
$("shown").addEventListener("change", e => { RESULTS[e.target.dataset.show].shown = e.target.checked; change("ti", state.ti, true); });
addEventListener("hashchange", () => { readAddress(); draw(true); });
draw(true);
