"use strict";

const OLD_AFTER_MS = 3000;
const RECONNECT_AFTER_MS = 8000;
const TRIES = 3;
const PATIENCE_MS = 1500;
const ANSWER_MS = 8000;
const token = new URLSearchParams(location.search).get("token");
const run = {};
let source = null;
let heard = 0;
let opened = 0;
let pictured = 0;
let answered = 0;

const at = (id) => document.getElementById(id);
const address = (path, more = {}) => {
  const query = new URLSearchParams({ ...more, ...(token ? { token } : {}) }).toString();
  return path + (query ? `?${query}` : "");
};
const put = (id, words) => {
  const element = at(id);
  if (element.textContent !== words) element.textContent = words;
};
const svg = (name, attributes, words) => {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (words !== undefined) element.textContent = words;
  return element;
};
const clock = (seconds) => {
  const whole = Math.max(0, Math.round(seconds));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
};

// -- the stream: reconnects by itself, and what is old never looks live ----------------------

function follow() {
  if (source) source.close();
  opened = Date.now();
  source = new EventSource(address("events"));
  for (const [name, show] of Object.entries(shows)) {
    source.addEventListener(name, (event) => {
      heard = Date.now();
      run[name] = JSON.parse(event.data);
      show(run[name]);
      watch();
    });
  }
}

function watch() {
  const silent = Date.now() - heard;
  const hung = run.now && run.now.silent_s;
  const over = run.end && run.end.final;
  const old = silent > OLD_AFTER_MS || hung;
  document.body.classList.toggle("old", Boolean(old) && !over);
  at("stale").hidden = !old;
  if (old && over) {
    put("stale", "The program has ended; this page shows how. Nothing here is live any more.");
    for (const name of ["stop", "pause", "skip"]) at(name).disabled = true;
    return;
  }
  if (silent > OLD_AFTER_MS) {
    const since = heard ? `What you see is from ${new Date(heard).toLocaleTimeString()}, ` +
      `${clock(silent / 1000)} min ago. ` : "";
    put("stale", `NOT LIVE: no connection to the run. ${since}Trying again. The arm may be moving:` +
      " to stop it, press Ctrl-C at the computer, or the robot's own button.");
    document.title = "OLD: cell run";
    if (Date.now() - opened > RECONNECT_AFTER_MS) follow();
  } else if (hung) {
    put("stale", `NOT LIVE: the run has not read the arm for ${run.now.silent_s} s. ` +
      "To stop the arm, press the robot's own button.");
  }
}

// -- the parts ------------------------------------------------------------------------------

function showRun(part) {
  put("name", part.name);
  put("devices", [part.arm, part.camera, `recording ${part.folder}`].filter(Boolean).join(", "));
  put("provenance", part.provenance);
  at("simulated").hidden = !part.simulated;
}

function stateWords(now) {
  const asked = now.asked;
  if (now.over) return run.end ? run.end.words : "the recording is over";
  if (asked.stop) return "stopping";
  const words = now.view ? `${now.state}: ${now.view}` : now.state;
  if (asked.skip) return `${words} (given up, goes on to the next)`;
  if (asked.pause && now.state !== "paused") return `${words} (pauses at the end of this move)`;
  return words;
}

function aloud(now) {
  if (now.over || now.asked.stop || now.state === "paused") return stateWords(now);
  return now.view ? `view ${now.done + now.skipped + 1} of ${now.total}` : now.state;
}

function showNow(now) {
  const left = now.over || now.left_s == null ? "" : `, ${clock(now.left_s)} left`;
  put("state", stateWords(now) + (now.total ? `, ${now.done + now.skipped} of ${now.total}${left}` : ""));
  put("aloud", aloud(now));
  document.title = `${now.over ? "over" : now.state} ${now.done ?? 0}/${now.total ?? "?"}: cell run`;
  if (now.total) {
    const finished = now.done + now.skipped;
    put("views", `${now.done} of ${now.total} taken` + (now.skipped ? `, ${now.skipped} given up` : ""));
    at("progress").firstElementChild.style.width = `${(100 * finished) / now.total}%`;
    at("progress").setAttribute("aria-valuemax", now.total);
    at("progress").setAttribute("aria-valuenow", finished);
  }
  const simulated = run.run && run.run.simulated ? " of simulated time" : "";
  put("left", now.over ? "none" : now.left_s == null ? "not known yet" : clock(now.left_s) + simulated);
  if (now.over) put("arm", "let go of");
  else if (now.arm) {
    const arm = now.arm;
    put("arm", `${arm.fault ? `FAULT: ${arm.fault}` : arm.motion}, flange at ` +
      `${arm.place_m.map((x) => x.toFixed(3)).join(", ")} m, joints ${arm.joints_deg.join(", ")}°`);
  }
  const paused = now.asked.pause;
  at("stop").disabled = now.over;
  at("pause").disabled = now.over || now.asked.stop;
  at("pause").setAttribute("aria-pressed", String(paused));
  at("pause").firstElementChild.textContent = paused ? "▶" : "❚❚";
  at("pause").querySelector(".label").textContent = paused ? "Go on" : "Pause";
  const skips = ["moving", "paused", "settling", "focusing", "grabbing"];
  at("skip").disabled = now.over || now.asked.stop || now.asked.skip || !skips.includes(now.state);
}

function showCamera(part) {
  put("camera", part.values.map((v) => `${v.name} ${v.value}`).join(", ") || "reports nothing");
}

function showFrame(frame) {
  put("frame-title", `Frame of ${frame.view}`);
  const verdict = at("frame-verdict");
  verdict.className = `verdict ${frame.fault ? "bad" : "good"}`;
  put("frame-verdict", frame.fault ? `Not kept: ${frame.fault}` :
    frame.corners ? `Kept, ${frame.corners.filter(Boolean).length} corners` : "Kept");
  pictured = frame.number;
  const image = new Image();
  image.onload = () => { if (pictured === frame.number) drawFrame(frame, image); };
  image.src = address("frame.jpg", { number: frame.number });
  meter("blur", frame.blur_px, frame.max_blur_px, (x) => `${x.toFixed(1)} px`);
  meter("saturated", frame.saturated, frame.max_saturated, (x) => `${(100 * x).toFixed(1)} %`);
}

function drawFrame(frame, image) {
  const { width, height } = frame;
  const found = frame.corners ? `${frame.corners.filter(Boolean).length} corners found` : "no corners";
  const drawing = at("picture");
  drawing.setAttribute("viewBox", `0 0 ${width} ${height}`);
  drawing.setAttribute("aria-label", `Frame of ${frame.view}: ${found}`);
  drawing.setAttribute("data-number", frame.number);
  image.id = "shot";
  image.alt = "";
  at("shot").replaceWith(image);
  const parts = [];
  if (frame.corners) {
    const first = frame.corners.slice(0, frame.columns).filter(Boolean);
    const dots = frame.corners.filter(Boolean).map(([u, v]) => `M${u},${v}h0`).join("");
    parts.push(svg("path", { d: `M${first.join("L")}`, class: "halo", "stroke-width": width / 130 }));
    parts.push(svg("path", { d: `M${first.join("L")}`, class: "first-row", "stroke-width": width / 300 }));
    parts.push(svg("path", { d: dots, class: "halo", "stroke-width": width / 80 }));
    parts.push(svg("path", { d: dots, class: "corners", "stroke-width": width / 130 }));
  }
  drawing.replaceChildren(...parts);
}

function meter(id, value, limit, words) {
  if (value == null) { put(id, "not measured"); return; }
  const bad = limit != null && value > limit;
  const full = Math.max(value, 1.5 * (limit ?? value)) || 1;
  const drawing = svg("svg", { viewBox: "0 0 300 16", role: "presentation" });
  drawing.append(svg("rect", { x: 0.5, y: 2.5, width: 299, height: 11, fill: "#eef1f4", stroke: "#9aa1ab" }));
  drawing.append(svg("rect", { x: 1, y: 3, width: (298 * value) / full, height: 10, fill: bad ? "#d55e00" : "#0072b2" }));
  if (limit != null) {
    const x = (298 * limit) / full;
    drawing.append(svg("path", { d: `M${x},0V16`, stroke: "#1c2127", "stroke-width": 2 }));
  }
  const text = limit == null ? words(value) :
    `${words(value)}, allowed ${words(limit)}: ${bad ? "too much ✗" : "good ✓"}`;
  at(id).replaceChildren(text, drawing);
}

function showEstimate(part) {
  const sigma = part.history.length ? part.history[part.history.length - 1][1] : null;
  if (!part.by_distance.length) {
    put("estimate", `not yet, with ${part.frames} frames`);
    put("lacks", part.missing);
  } else {
    const rows = part.by_distance;
    const worst = Math.max(...rows.map((row) => row[2]));
    const goal = part.goal_px ? `; goal ${part.goal_px} px: ${worst <= part.goal_px ? "reached ✓" : "not reached yet"}` : "";
    put("estimate", `${worst.toPrecision(3)} px at worst, from ${rows[0][0].toFixed(2)} to ` +
      `${rows[rows.length - 1][0].toFixed(2)} m, after ${part.used} frames${goal}`);
    const few = part.min_views && part.used < part.min_views ? [`${part.min_views} frames`] : [];
    const lacks = [...few, ...part.lacks];
    put("lacks", lacks.length ? `Not to be believed before there are: ${lacks.join("; ")}.` :
      "The plan's distances and tilts are covered.");
  }
  drawFalling(part, sigma);
}

function drawFalling(part, sigma) {
  const drawing = at("falling");
  drawing.replaceChildren();
  if (!part.history.length) return;
  const box = { left: 44, right: 350, top: 12, bottom: 138 };
  const values = part.history.map((p) => p[1]).concat(part.goal_px ? [part.goal_px] : []);
  const low = Math.log10(Math.min(...values)) - 0.1;
  const high = Math.log10(Math.max(...values)) + 0.1;
  const last = Math.max(...part.history.map((p) => p[0]), run.now?.total ?? 0);
  const x = (frames) => box.left + ((box.right - box.left) * frames) / last;
  const y = (value) => box.bottom - ((box.bottom - box.top) * (Math.log10(value) - low)) / (high - low);
  drawing.append(svg("path", { d: `M${box.left},${box.top}V${box.bottom}H${box.right}`, fill: "none", stroke: "#5b616b" }));
  for (const value of ticks(low, high)) {
    drawing.append(svg("path", { d: `M${box.left - 4},${y(value)}h4`, stroke: "#5b616b" }));
    drawing.append(svg("text", { x: box.left - 7, y: y(value) + 4, "text-anchor": "end" }, `${value}`));
  }
  drawing.append(svg("text", { x: box.right, y: box.bottom + 16, "text-anchor": "end" }, `${last} frames`));
  drawing.append(svg("text", { x: box.left, y: box.bottom + 16 }, "0"));
  drawing.append(svg("text", { x: box.left + 6, y: box.top + 4 }, "sigma of alpha, px"));
  if (part.goal_px) {
    drawing.append(svg("path", { d: `M${box.left},${y(part.goal_px)}H${box.right}`, stroke: "#d55e00", "stroke-width": 2, "stroke-dasharray": "7 5" }));
    drawing.append(svg("text", { x: box.right, y: y(part.goal_px) - 5, "text-anchor": "end" }, `goal ${part.goal_px}`));
  }
  const path = part.history.map(([frames, value]) => `${x(frames)},${y(value)}`);
  drawing.append(svg("path", { d: `M${path.join("L")}`, fill: "none", stroke: "#0072b2", "stroke-width": 2 }));
  for (const [frames, value] of part.history) {
    drawing.append(svg("circle", { cx: x(frames), cy: y(value), r: 3.5, fill: "#0072b2" }));
  }
  drawing.setAttribute("aria-label", `Sigma of alpha over frames, now ${sigma} px` +
    (part.goal_px ? `, goal ${part.goal_px} px` : ""));
}

function ticks(low, high) {
  const found = [];
  for (let power = Math.floor(low); power <= high; power += 1) {
    for (const step of [1, 2, 5]) {
      const value = Number((step * 10 ** power).toPrecision(1));
      if (Math.log10(value) >= low && Math.log10(value) <= high) found.push(value);
    }
  }
  return found;
}

function showCoverage(part) {
  drawCells(part);
  drawDistances(part);
  drawTilts(part);
}

function drawCells(part) {
  const drawing = at("cells");
  const { columns, rows } = part;
  const wide = 360 / columns;
  const tall = 270 / rows;
  const most = Math.max(1, ...part.seen_cells);
  drawing.replaceChildren();
  part.seen_cells.forEach((seen, k) => {
    const x = (k % columns) * wide;
    const y = Math.floor(k / columns) * tall;
    const depth = seen / most;
    const fill = seen ? `rgb(${Math.round(214 - 214 * depth)},${Math.round(232 - 118 * depth)},${Math.round(244 - 66 * depth)})` : "#fff";
    drawing.append(svg("rect", { x: x + 1, y: y + 1, width: wide - 2, height: tall - 2, fill, stroke: "#9aa1ab" }));
    if (!seen && part.planned_cells[k]) {
      drawing.append(svg("rect", { x: x + 5, y: y + 5, width: wide - 10, height: tall - 10, fill: "none", stroke: "#1c2127", "stroke-dasharray": "3 4" }));
    }
    const dark = depth > 0.55;
    const words = svg("text", { x: x + wide / 2, y: y + tall / 2 + 5, "text-anchor": "middle" }, seen || "");
    words.style.fill = dark ? "#fff" : "#1c2127";
    drawing.append(words);
  });
  const seen = part.seen_cells.filter(Boolean).length;
  const planned = part.planned_cells.filter((n, k) => n || part.seen_cells[k]).length;
  const words = `${seen} of ${planned} parts of the image seen`;
  drawing.setAttribute("aria-label", words);
  put("cells-words", `Where in the image: ${words}. Numbers count frames, dashes are planned.`);
}

function marks(drawing, part, place) {
  const taken = new Set(part.seen_views);
  part.planned.forEach((view, k) => {
    const [cx, cy] = place(view);
    if (!taken.has(k)) drawing.append(svg("circle", { cx, cy, r: 5, fill: "none", stroke: "#5b616b", "stroke-width": 1.5 }));
  });
  part.seen.forEach((view) => {
    const [cx, cy] = place(view);
    drawing.append(svg("circle", { cx, cy, r: 5, fill: "#0072b2", stroke: "#fff" }));
  });
  drawing.setAttribute("aria-label", `${part.seen.length} of ${part.planned.length} planned views seen`);
}

function drawDistances(part) {
  const drawing = at("distances");
  drawing.replaceChildren();
  const all = [...part.planned, ...part.seen];
  if (!all.length) { unknown(drawing); return; }
  const box = { left: 40, right: 345, top: 14, bottom: 228 };
  const near = Math.min(...all.map((v) => v[0]));
  const span = Math.max(...all.map((v) => v[0])) - near || 0.1;
  const steep = Math.max(10, ...all.map((v) => v[1]));
  const place = ([distance, tilt]) => [
    box.left + 8 + ((box.right - box.left - 16) * (distance - near)) / span,
    box.bottom - 8 - ((box.bottom - box.top - 16) * tilt) / steep,
  ];
  drawing.append(svg("path", { d: `M${box.left},${box.top}V${box.bottom}H${box.right}`, fill: "none", stroke: "#5b616b" }));
  for (const share of [0, 0.5, 1]) {
    const [x] = place([near + share * span, 0]);
    drawing.append(svg("text", { x, y: box.bottom + 18, "text-anchor": "middle" }, (near + share * span).toFixed(2)));
  }
  for (let tilt = 0; tilt <= steep; tilt += steep > 30 ? 15 : 5) {
    const [, y] = place([near, tilt]);
    drawing.append(svg("text", { x: box.left - 6, y: y + 4, "text-anchor": "end" }, `${tilt}°`));
  }
  drawing.append(svg("text", { x: (box.left + box.right) / 2, y: box.bottom + 36, "text-anchor": "middle" }, "distance, m"));
  marks(drawing, part, place);
}

function drawTilts(part) {
  const drawing = at("tilts");
  drawing.replaceChildren();
  const all = [...part.planned, ...part.seen];
  if (!all.length) { unknown(drawing); return; }
  const most = Math.max(10, ...all.map((v) => v[1]));
  const place = ([, tilt, direction]) => {
    const radius = (118 * tilt) / most;
    const turn = (direction * Math.PI) / 180;
    return [180 + radius * Math.cos(turn), 135 + radius * Math.sin(turn)];
  };
  for (let ring = 15; ring <= most; ring += 15) {
    drawing.append(svg("circle", { cx: 180, cy: 135, r: (118 * ring) / most, fill: "none", stroke: "#d9dde3" }));
    drawing.append(svg("text", { x: 183, y: 133 - (118 * ring) / most }, `${ring}°`));
  }
  drawing.append(svg("path", { d: "M180,10V260M55,135H305", stroke: "#d9dde3" }));
  drawing.append(svg("text", { x: 310, y: 139 }, "right"));
  drawing.append(svg("text", { x: 180, y: 269, "text-anchor": "middle" }, "down"));
  marks(drawing, part, place);
}

function unknown(drawing) {
  drawing.append(svg("text", { x: 180, y: 135, "text-anchor": "middle" }, "not known before the first estimate"));
}

function showMessages(part) {
  at("messages").replaceChildren(...part.lines.map((line) => {
    const item = document.createElement("li");
    const when = document.createElement("time");
    when.textContent = line.at;
    item.append(when, line.words);
    return item;
  }));
}

function showEnd(end) {
  at("end").hidden = false;
  put("end-words", end.words);
  put("end-reason", end.reason || "");
  put("end-result", end.result || "Calibration and diagnosis follow.");
  at("end-files").replaceChildren(...Object.entries(end.files || {}).map(([what, path]) => {
    const item = document.createElement("li");
    item.textContent = `${what}: ${path}`;
    return item;
  }));
}

// -- the buttons ----------------------------------------------------------------------------

async function ask(path, more) {
  for (let attempt = 1; attempt <= TRIES; attempt += 1) {
    try {
      const response = await fetch(address(path, more), {
        method: "POST",
        headers: { "x-cell-page": "1" },
        keepalive: true,
        signal: AbortSignal.timeout(PATIENCE_MS),
      });
      const answered = response.headers.get("content-type") === "application/json" ?
        (await response.json()).words : (await response.text()).trim();
      answer(answered, !response.ok);
      return;
    } catch {
      answer(`${path === "stop" ? "Stop" : "That"} has not got through yet, trying again.`, true);
    }
  }
  answer(path === "stop" ?
    "THE STOP DID NOT GET THROUGH. Press the robot's own button, or Ctrl-C at the computer." :
    "That did not get through.", true);
}

function answer(words, bad) {
  clearTimeout(answered);
  if (!bad) answered = setTimeout(() => { at("answer").hidden = true; }, ANSWER_MS);
  at("answer").hidden = false;
  at("answer").classList.toggle("bad", bad);
  put("answer", words);
}

at("stop").addEventListener("click", () => ask("stop"));
at("pause").addEventListener("click", () => ask(run.now?.asked.pause ? "go-on" : "pause"));
at("skip").addEventListener("click", () => ask("skip", { view: run.now?.index ?? "" }));

const shows = {
  run: showRun, now: showNow, camera: showCamera, frame: showFrame, coverage: showCoverage,
  estimate: showEstimate, messages: showMessages, end: showEnd,
};
follow();
setInterval(watch, 500);
