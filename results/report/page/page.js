// The report's page: draws the finished numbers of its data (report_data.h) with Chart.js, as
// the controls ask for.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const lines = new Set(data.lines.map((_, i) => i));
  const singleSeeds = new Set();
  const chosen = {axis: data.axes[0], statistic: data.statistics[0], scale: "linear", range: "ours"};

  // --- how things look: the styles of the static pictures; black turns white on dark paper
  const colour = (style) => dark.matches && style.colour === "#000000" ? "#FFFFFF" : style.colour;
  const dash = (style) => style.dash ? style.dash.split(",").map(Number) : [];
  const property = (name) => getComputedStyle(document.documentElement).getPropertyValue(name);
  const pointStyles = {circle: "circle", square: "rect", triangle: "triangle", diamond: "rectRot"};
  function marker(style) {
    const shape = style.marker.replace("open ", "").replace("down ", "");
    return {pointStyle: pointStyles[shape], pointRotation: style.marker.startsWith("down ") ? 180 : 0,
            pointBackgroundColor: style.marker.startsWith("open ") ? property("--panel") : colour(style)};
  }
  const styleOf = (curve) => data.styles[data.lines[curve.line].style];
  const labelOf = (curve) => data.lines[curve.line].label;

  function short(value) {
    const size = Math.abs(value);
    const trim = (v, unit) => parseFloat(v.toPrecision(3)) + unit;
    return size >= 1e9 ? trim(value / 1e9, "G") : size >= 1e6 ? trim(value / 1e6, "M")
         : size >= 1e4 ? trim(value / 1e3, "k") : trim(value, "");
  }
  const describe = (curve, point) => `${labelOf(curve)}: ${short(point.y)} (${short(point.lo)} to ${short(point.hi)}, ` +
      `n = ${curve.n}) at ${short(point.x)}`;

  // --- curves
  const pointsOf = (curve) => curve.x[chosen.axis.key].map((x, i) => (
      {x, y: curve[chosen.statistic.key][i], lo: curve.lo[i], hi: curve.hi[i], env_step: curve.env_step[i]}));
  const along = (xs, ys) => xs.map((x, i) => ({x, y: ys[i]}));

  function datasets(curve, points) {
    const style = styleOf(curve);
    const ink = colour(style);
    const xs = curve.x[chosen.axis.key];
    const sets = [];
    if (curve.interval) {
      const band = {pointRadius: 0, pointHitRadius: 0, borderWidth: 0, backgroundColor: ink + "33"};
      sets.push({...band, data: along(xs, curve.lo), fill: false});
      sets.push({...band, data: along(xs, curve.hi), fill: "-1"});
    } else if (curve.n === 2) {
      const each = {showLine: false, pointRadius: 2, borderColor: ink, backgroundColor: ink, ...marker(style)};
      sets.push({...each, data: along(xs, curve.lo)}, {...each, data: along(xs, curve.hi)});
    }
    const single = curve.runs.filter((run) => singleSeeds.has(run.seed));
    for (const run of [...curve.tails, ...single]) {
      sets.push({data: along(run.x[chosen.axis.key], run.y), borderColor: ink, borderWidth: 0.8, pointRadius: 0,
                 pointHitRadius: 0, fill: false});
    }
    sets.push({curve, data: points, borderColor: ink, backgroundColor: ink, borderWidth: 2, borderDash: dash(style),
               ...marker(style), pointRadius: points.length > 30 ? 0 : 3, pointHitRadius: 8, fill: false});
    return sets;
  }

  function scale(title, more) {
    const ink = property("--ink");
    return {type: "linear", title: {display: true, text: title, color: ink}, grid: {color: property("--line")},
            ticks: {color: ink, callback: short, maxTicksLimit: 6}, ...more};
  }
  function xScale() {
    const end = chosen.axis === data.axes[0] && chosen.range === "ours" && chosen.scale === "linear" ? data.x_end : null;
    return scale(chosen.axis.title, {...(end === null ? {} : {max: end}),
                                     ...(chosen.scale === "log" ? {type: "logarithmic"} : {beginAtZero: true})});
  }
  function newChart(canvas, configuration) {
    const old = Chart.getChart(canvas);
    if (old) old.destroy();
    configuration.options = {animation: false, responsive: true, maintainAspectRatio: false, ...configuration.options};
    return new Chart(canvas, configuration);
  }

  function drawCurves(figure) {
    const chart = data.charts[Number(figure.dataset.chart)];
    const shown = chart.curves.filter((curve) => lines.has(curve.line) && curve.x[chosen.axis.key])
        .map((curve) => ({curve, points: pointsOf(curve)})).filter(({points}) => points.length > 0);
    const canvas = figure.querySelector("canvas");
    newChart(canvas, {
      type: "line",
      data: {datasets: shown.flatMap(({curve, points}) => datasets(curve, points))},
      options: {
        parsing: false, normalized: false, interaction: {mode: "nearest", axis: "x", intersect: false},
        scales: {x: xScale(), y: scale(chart.y_title, {beginAtZero: true})},
        plugins: {
          legend: {display: false},
          tooltip: {
            filter: (item) => Boolean(item.dataset.curve),
            callbacks: {title: () => "", label: (item) => describe(item.dataset.curve, item.raw)},
          },
        },
      },
    });
    figure.querySelector(".counts").textContent = shown.length
        ? shown.map(({curve}) => `${labelOf(curve)} n = ${curve.n}`).join(", ")
        : "nothing to show for this choice";
    readByKeyboard(canvas, figure.querySelector(".readout"), shown);
    const table = figure.querySelector("details.points");
    table.ontoggle = () => { if (table.open) fillTable(table, shown); };
    if (table.open) fillTable(table, shown);
  }

  // The points from left to right, read out as they are passed.
  function readByKeyboard(canvas, readout, shown) {
    const all = shown.flatMap(({curve, points}) => points.map((point) => ({curve, point})));
    all.sort((a, b) => a.point.x - b.point.x || a.curve.line - b.curve.line);
    const last = all.length - 1;
    let at = -1;
    canvas.onkeydown = (event) => {
      const next = {ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: last}[event.key];
      if (next === undefined || last < 0) return;
      event.preventDefault();
      at = Math.min(last, Math.max(0, next));
      readout.textContent = describe(all[at].curve, all[at].point);
    };
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
        if (typeof cell === "number" || (tag === "th" && cell !== "line")) element.className = "number";
      }
    };
    row(["line", "env_step", "x", chosen.statistic.title, "lo", "hi", "n"], "th");
    const round = (v) => parseFloat(v.toPrecision(6));
    for (const {curve, points} of shown) {
      for (const p of points) {
        row([labelOf(curve), p.env_step, round(p.x), round(p.y), round(p.lo), round(p.hi), curve.n], "td");
      }
    }
  }

  // A long name over several lines: an axis cuts off what is longer than half of the chart.
  function linesOf(name) {
    const longest = 40;
    const lines = [""];
    for (const word of name.split(" ")) {
      const line = lines[lines.length - 1];
      if (line && line.length + 1 + word.length > longest) lines.push(word);
      else lines[lines.length - 1] = line ? `${line} ${word}` : word;
    }
    return lines;
  }

  function drawTime() {
    const {planners, activities} = data.time;
    const canvas = byId("time-chart");
    const names = planners.map(linesOf);
    const height = 7 + 1.2 * (names.length + names.flat().length);
    canvas.parentElement.style.height = `${height}rem`;
    newChart(canvas, {
      type: "bar",
      data: {labels: names,
             datasets: activities.map(({name, style, seconds}) => (
                 {label: name, data: seconds, backgroundColor: colour(data.styles[style])}))},
      options: {
        indexAxis: "y",
        scales: {x: scale("seconds for 1,000 environment steps", {stacked: true}),
                 y: {stacked: true, ticks: {color: property("--ink")}, grid: {color: property("--line")}}},
        plugins: {legend: {labels: {color: property("--ink")}},
                  tooltip: {callbacks: {label: (item) => `${item.dataset.label}: ${short(item.raw)} s`}}},
      },
    });
  }

  // --- only what is on the screen is drawn, so that a page of many tasks opens at once
  const visible = new Set();
  function draw() {
    for (const figure of visible) drawCurves(figure);
    drawTime();
  }
  const observer = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting || visible.has(entry.target)) continue;
      visible.add(entry.target);
      drawCurves(entry.target);
    }
  }, {rootMargin: "400px"});
  function place(chart, index) {
    const figure = byId("chart").content.firstElementChild.cloneNode(true);
    figure.dataset.chart = index;
    figure.querySelector("h3").textContent = chart.name;
    figure.querySelector("canvas").setAttribute(
        "aria-label", `Learning curves, ${chart.name}. Arrow keys read out the points.`);
    byId(chart.over_tasks ? "over-tasks-chart" : "task-charts").appendChild(figure);
    observer.observe(figure);
  }

  // --- the controls
  function sample(style) {
    const holder = document.createElement("span");
    holder.innerHTML = '<svg class="sample" viewBox="0 0 36 14" aria-hidden="true"><line x1="0" x2="36" y1="7" y2="7"' +
        ` stroke="${colour(style)}" stroke-width="3" stroke-dasharray="${style.dash}"/></svg>`;
    return holder.firstChild;
  }
  function choice(parent, type, name, text, checked, change, style) {
    const element = document.createElement("label");
    const input = element.appendChild(document.createElement("input"));
    input.type = type;
    input.name = name;
    input.value = text;
    input.checked = checked;
    input.addEventListener("change", () => { change(input.checked); draw(); });
    if (style) element.appendChild(sample(style));
    element.appendChild(document.createTextNode(text));
    parent.appendChild(element);
  }
  function group(title) {
    const set = byId("controls").appendChild(document.createElement("fieldset"));
    set.appendChild(document.createElement("legend")).textContent = title;
    return set;
  }
  function radio(title, key, options) {
    const set = group(title);
    for (const [value, text] of options) {
      choice(set, "radio", key, text, value === chosen[key], () => { chosen[key] = value; });
    }
  }
  const toggle = (set, item) => (checked) => { if (checked) set.add(item); else set.delete(item); };

  byId("controls").hidden = false;
  const planners = group("planners");
  data.lines.forEach(({label, style}, i) => (
      choice(planners, "checkbox", "line", label, true, toggle(lines, i), data.styles[style])));
  radio("x axis", "axis", data.axes.map((axis) => [axis, axis.name]));
  radio("over seeds", "statistic", data.statistics.map((statistic) => [statistic, statistic.title]));
  const seeds = group("single runs, by seed");
  for (const seed of data.seeds) choice(seeds, "checkbox", "seed", seed, false, toggle(singleSeeds, seed));
  radio("x scale", "scale", [["linear", "linear"], ["log", "logarithmic"]]);
  if (data.x_end !== null) radio("x range", "range", [["ours", "of these runs"], ["all", "of published curves too"]]);
  dark.addEventListener("change", draw);
  data.charts.forEach(place);
  drawTime();
})();
