// The report's page: draws its data with Chart.js as the controls ask for.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const dark = matchMedia("(prefers-color-scheme: dark)");
  // Okabe and Ito 2008, as in the static pictures; black turns white on dark paper.
  const colours = () => ["#0072B2", "#D55E00", "#009E73", "#CC79A7", dark.matches ? "#FFFFFF" : "#000000",
                         "#E69F00", "#56B4E9", "#888888"];
  const dashes = [[], [9, 3], [4, 2], [9, 3, 2, 3], [2, 2], [14, 4], [7, 2, 2, 2, 2, 2], [2, 5]];
  const markers = ["circle", "rect", "triangle", "rectRot", "rectRounded", "star", "cross", "crossRot"];
  const byId = (id) => document.getElementById(id);
  const state = {x: "steps", statistic: "mean", scale: "linear", range: "ours", labels: new Set(data.labels.map((_, i) => i)),
                 seeds: new Set(data.seeds)};
  const axisNames = {steps: "environment steps (before action repeat)",
                     seconds: "seconds, evaluation and recording left out",
                     transitions: "model transitions imagined by planning"};

  function short(value) {
    const size = Math.abs(value);
    const trim = (v, unit) => parseFloat(v.toPrecision(3)) + unit;
    return size >= 1e9 ? trim(value / 1e9, "G") : size >= 1e6 ? trim(value / 1e6, "M")
         : size >= 1e4 ? trim(value / 1e3, "k") : trim(value, "");
  }

  function mean(values) { return values.reduce((a, b) => a + b, 0) / values.length; }
  // Mean without the floor(n / 4) smallest and greatest.
  function interquartileMean(values) {
    const sorted = [...values].sort((a, b) => a - b);
    const cut = Math.floor(sorted.length / 4);
    return mean(sorted.slice(cut, sorted.length - cut));
  }
  const middle = (values) => state.statistic === "mean" ? mean(values) : interquartileMean(values);

  function xOf(run, i, line) {
    return state.x === "steps" ? line.steps[i] : state.x === "seconds" ? run.s && run.s[i] : run.m && run.m[i];
  }

  // Points of a line over the chosen seeds, where all that have data have a point.
  function pointsOf(line) {
    const runs = line.runs.filter((run) => (line.published || state.seeds.has(run.seed)) &&
                                           run.y.some((y) => y !== null));
    const points = [];
    line.steps.forEach((step, i) => {
      const there = runs.filter((run) => run.y[i] !== null && run.y[i] !== undefined);
      if (there.length === 0 || there.length < runs.length) return;
      const xs = there.map((run) => xOf(run, i, line));
      if (xs.some((x) => x === null || x === undefined)) return;
      const ys = there.map((run) => run.y[i]);
      points.push({x: mean(xs), y: middle(ys), lo: Math.min(...ys), hi: Math.max(...ys), n: ys.length, ys, step});
    });
    return points;
  }

  // Over tasks: by seed the mean of normalised scores, where every task has a point.
  function overTasks(label) {
    const lines = data.lines.filter((line) => line.label === label);
    if (lines.length !== data.tasks.length || lines.some((line) => data.tasks[line.task].high === null)) return null;
    const steps = lines[0].steps.filter((step) => lines.every((line) => line.steps.includes(step)));
    const published = lines[0].published;
    const seeds = [...new Set(lines.flatMap((line) => line.runs.map((run) => run.seed)))]
        .filter((seed) => published || state.seeds.has(seed));
    const points = [];
    for (const step of steps) {
      const scores = [], xs = [], all = [];
      for (const seed of seeds) {
        const cells = lines.map((line) => {
          const i = line.steps.indexOf(step);
          const run = line.runs.find((r) => r.seed === seed);
          if (!run || run.y[i] === null || run.y[i] === undefined) return null;
          const {low, high} = data.tasks[line.task];
          return {x: xOf(run, i, line), y: (run.y[i] - low) / (high - low)};
        });
        if (cells.some((cell) => cell === null || cell.x === null || cell.x === undefined)) continue;
        scores.push(mean(cells.map((cell) => cell.y)));
        all.push(...cells.map((cell) => cell.y));
        xs.push(...cells.map((cell) => cell.x));
      }
      if (scores.length === 0 || scores.length < seeds.length) continue;
      points.push({x: mean(xs), y: state.statistic === "mean" ? mean(scores) : interquartileMean(all),
                   lo: Math.min(...scores), hi: Math.max(...scores), n: scores.length, ys: scores, step});
    }
    return points;
  }

  function datasets(label, points) {
    const colour = colours()[label % 8];
    const n = points.length ? points[0].n : 0;
    const sets = [];
    // An interval needs three seeds; the interquartile mean of all tasks has other ends.
    if (n >= 3) {
      const band = {label: null, pointRadius: 0, pointHitRadius: 0, borderWidth: 0, backgroundColor: colour + "33"};
      sets.push({...band, data: points.map((p) => ({x: p.x, y: p.lo})), fill: false});
      sets.push({...band, data: points.map((p) => ({x: p.x, y: p.hi})), fill: "-1"});
    } else if (n === 2) {
      sets.push({label: null, showLine: false, pointRadius: 2, borderColor: colour, backgroundColor: colour,
                 pointStyle: markers[label % 8],
                 data: points.flatMap((p) => p.ys.map((y) => ({x: p.x, y})))});
    }
    sets.push({label: data.labels[label], data: points, borderColor: colour, backgroundColor: colour,
               borderWidth: 2, borderDash: dashes[label % 8], pointStyle: markers[label % 8],
               pointRadius: points.length > 30 ? 0 : 3, pointHitRadius: 8, fill: false});
    return sets;
  }

  const describe = (name, point) =>
      `${name}: ${short(point.y)} (${short(point.lo)} to ${short(point.hi)}, n = ${point.n}) at ${short(point.x)}`;

  // The last x of our own lines: published curves may be many times as long.
  function ownEnd(shown) {
    if (state.range === "all") return undefined;
    const published = (label) => data.lines.some((line) => line.label === label && line.published);
    const own = shown.filter(({label}) => !published(label)).flatMap(({points}) => points.map((p) => p.x));
    return own.length && own.length < shown.flatMap(({points}) => points).length ? Math.max(...own) : undefined;
  }

  const charts = [];
  function drawCurve(figure) {
    const task = figure.dataset.task === "all" ? null : Number(figure.dataset.task);
    const shown = [];
    for (const label of state.labels) {
      const line = task === null ? null : data.lines.find((l) => l.task === task && l.label === label);
      const points = task === null ? overTasks(label) : line ? pointsOf(line) : [];
      if (points && points.length) shown.push({label, points});
    }
    const style = getComputedStyle(document.documentElement);
    const ink = style.getPropertyValue("--ink"), grid = style.getPropertyValue("--line");
    const canvas = figure.querySelector("canvas");
    const readout = figure.querySelector(".readout");
    const old = Chart.getChart(canvas);
    if (old) old.destroy();
    const scale = (title, more) => ({type: "linear", title: {display: true, text: title, color: ink},
                                     ticks: {color: ink, callback: short, maxTicksLimit: 6}, grid: {color: grid}, ...more});
    const chart = new Chart(canvas, {
      type: "line",
      data: {datasets: shown.flatMap(({label, points}) => datasets(label, points))},
      options: {
        animation: false, responsive: true, maintainAspectRatio: false, parsing: false, normalized: false,
        interaction: {mode: "nearest", axis: "x", intersect: false},
        scales: {
          x: scale(axisNames[state.x], {max: ownEnd(shown),
                                        ...(state.scale === "log" ? {type: "logarithmic"} : {beginAtZero: true})}),
          y: scale(task === null ? "normalised return" : "evaluation return", {beginAtZero: true}),
        },
        plugins: {
          legend: {display: false},
          tooltip: {
            filter: (item) => Boolean(item.dataset.label),
            callbacks: {title: () => "", label: (item) => describe(item.dataset.label, item.raw)},
          },
        },
      },
    });
    figure.querySelector(".counts").textContent = shown.length
        ? shown.map(({label, points}) => `${data.labels[label]} n = ${points[0].n}`).join(", ")
        : "nothing to show for this choice";
    // The points by keyboard, read out as they are passed.
    let at = -1;
    canvas.onkeydown = (event) => {
      const lines = shown.flatMap(({label, points}) => points.map((p) => ({label, p})));
      lines.sort((a, b) => a.p.x - b.p.x || a.label - b.label);
      const step = {ArrowRight: 1, ArrowLeft: -1, Home: -Infinity, End: Infinity}[event.key];
      if (step === undefined || lines.length === 0) return;
      event.preventDefault();
      at = Math.min(lines.length - 1, Math.max(0, step === -Infinity ? 0 : step === Infinity ? lines.length - 1 : at + step));
      readout.textContent = describe(data.labels[lines[at].label], lines[at].p);
    };
    const table = figure.querySelector("details.points");
    table.ontoggle = () => { if (table.open) fillTable(table, shown); };
    if (table.open) fillTable(table, shown);
    charts.push(chart);
  }

  function fillTable(details, shown) {
    const table = details.querySelector("table") || details.appendChild(document.createElement("table"));
    table.textContent = "";
    const row = (cells, tag) => {
      const tr = table.insertRow();
      for (const cell of cells) {
        const element = tr.appendChild(document.createElement(tag));
        element.textContent = cell;
        if (tag === "th") element.scope = "col";
        else if (typeof cell === "number") element.className = "number";
      }
    };
    row(["line", "env_step", "x", state.statistic, "least", "greatest", "n"], "th");
    for (const {label, points} of shown) {
      for (const p of points) {
        const round = (v) => parseFloat(v.toPrecision(6));
        row([data.labels[label], p.step, round(p.x), round(p.y), round(p.lo), round(p.hi), p.n], "td");
      }
    }
  }

  function drawTime() {
    const canvas = byId("time-chart");
    if (!canvas) return;
    const style = getComputedStyle(document.documentElement);
    const ink = style.getPropertyValue("--ink"), grid = style.getPropertyValue("--line");
    const old = Chart.getChart(canvas);
    if (old) old.destroy();
    new Chart(canvas, {
      type: "bar",
      data: {labels: data.time.planners,
             datasets: data.time.activities.map((activity, i) => (
                 {label: activity.name, data: activity.seconds, backgroundColor: colours()[i % 8]}))},
      options: {
        animation: false, responsive: true, maintainAspectRatio: false, indexAxis: "y",
        scales: {x: {stacked: true, ticks: {color: ink, callback: short}, grid: {color: grid},
                     title: {display: true, text: "seconds for 1,000 environment steps", color: ink}},
                 y: {stacked: true, ticks: {color: ink}, grid: {color: grid}}},
        plugins: {legend: {labels: {color: ink}},
                  tooltip: {callbacks: {label: (item) => `${item.dataset.label}: ${short(item.raw)} s`}}},
      },
    });
  }

  // Only what is on the screen is drawn, so that a page of many tasks opens at once.
  const visible = new Set();
  function draw() {
    for (const figure of visible) drawCurve(figure);
    drawTime();
    document.body.dataset.drawn = String(Number(document.body.dataset.drawn || 0) + 1);
  }
  const observer = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting || visible.has(entry.target)) continue;
      visible.add(entry.target);
      drawCurve(entry.target);
    }
  }, {rootMargin: "400px"});

  function sample(label) {
    const svg = `<svg class="sample" viewBox="0 0 36 14" aria-hidden="true"><line x1="0" x2="36" y1="7" y2="7"` +
        ` stroke="${colours()[label % 8]}" stroke-width="3" stroke-dasharray="${dashes[label % 8].join(" ")}"/></svg>`;
    const holder = document.createElement("span");
    holder.innerHTML = svg;
    return holder.firstChild;
  }
  function choice(parent, type, name, text, checked, change, label) {
    const element = document.createElement("label");
    const input = element.appendChild(document.createElement("input"));
    input.type = type;
    input.name = name;
    input.value = text;
    input.checked = checked;
    input.addEventListener("change", () => { change(input.checked); draw(); });
    if (label !== undefined) element.appendChild(sample(label));
    element.appendChild(document.createTextNode(text));
    parent.appendChild(element);
  }
  function group(title) {
    const set = byId("controls").appendChild(document.createElement("fieldset"));
    set.appendChild(document.createElement("legend")).textContent = title;
    return set;
  }

  byId("controls").hidden = false;
  const toggle = (set, item) => (checked) => { if (checked) set.add(item); else set.delete(item); };
  const planners = group("planners");
  data.labels.forEach((text, i) => choice(planners, "checkbox", "label", text, true, toggle(state.labels, i), i));
  const seeds = group("seeds");
  for (const seed of data.seeds) choice(seeds, "checkbox", "seed", String(seed), true, toggle(state.seeds, seed));
  const radio = (title, key, options) => {
    const set = group(title);
    options.forEach(([value, text], i) => choice(set, "radio", key, text, i === 0, () => { state[key] = value; }));
  };
  radio("x axis", "x", [["steps", "steps"], ["transitions", "model transitions"], ["seconds", "seconds"]]);
  radio("over seeds", "statistic", [["mean", "mean"], ["iqm", "interquartile mean"]]);
  radio("x scale", "scale", [["linear", "linear"], ["log", "logarithmic"]]);
  if (data.lines.some((line) => line.published)) {
    radio("x range", "range", [["ours", "of these runs"], ["all", "of published curves too"]]);
  }
  dark.addEventListener("change", draw);
  document.querySelectorAll("figure[data-task]").forEach((figure) => observer.observe(figure));
  drawTime();
})();
