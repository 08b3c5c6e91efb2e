// The page of one decision: draws the tree in its data.
"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const edges = data.edges;
const $ = id => document.getElementById(id);

// Children of every edge, and of the root (key -1), most visited first, then by Q.
const children = new Map();
edges.forEach((edge, i) => {
  if (!children.has(edge.parent)) children.set(edge.parent, []);
  children.get(edge.parent).push(i);
});
const better = (a, b) => edges[b].visits - edges[a].visits || edges[b].q - edges[a].q || a - b;
for (const list of children.values()) list.sort(better);
const childrenOf = i => children.get(i) || [];

function number(x) {
  if (x === null || x === undefined) return "";
  if (Number.isInteger(x) && Math.abs(x) < 1e6) return String(x);
  const size = Math.abs(x);
  return size !== 0 && (size < 0.001 || size >= 1e5) ? x.toExponential(2) : x.toPrecision(4);
}
const component = x => (x < 0 ? "\u2212" : "+") + Math.abs(x).toFixed(2);
function action(values, most) {
  const shown = values.slice(0, most).map(component).join(" ");
  return values.length > most ? shown + " …" : shown;
}
function element(name, text, className) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (className) made.className = className;
  return made;
}

// --- what was decided
const place = data.phase === "training" ? "training episode" : "evaluation episode";
$("title").textContent = `Decision ${data.decision} of ${place} ${data.episode}`;
document.title = `${data.env} ${data.planner}: decision ${data.decision} of ${place} ${data.episode}`;
$("about").textContent = `${data.env}, planner ${data.planner} on ${data.model}, seed ${data.seed}; ` +
  `run ${data.run_id} (${data.run_uuid.slice(0, 8)}) after ${data.env_step.toLocaleString("en")} environment steps`;
function fact(name, value, help) {
  const box = element("div");
  if (help) box.title = help;
  box.append(element("dt", name), element("dd", value));
  $("summary").append(box);
}
fact("played action", action(data.action, 8));
fact("root value", number(data.root.value), "the planner's estimate");
fact("root visits", number(data.root.visits), "sum over the root's actions");
fact("visit entropy", number(data.root.visit_entropy) + " nats", "of the visits over the root's actions; 0: one action has all");
fact("simulations", number(data.root.simulations));
fact("nodes", number(data.root.nodes));
fact("depth", number(data.root.depth), "most transitions from the root");
for (const metric of data.root.metrics) {
  if (metric.name === "root_visit_entropy") continue;
  fact(metric.name.replaceAll("_", " "), number(metric.value) + (metric.unit ? " " + metric.unit : ""), metric.help);
}

// --- the root's actions
const roots = childrenOf(-1);
$("note").textContent = data.chosen_is_exact
  ? "The played action is marked."
  : "The played action is none of the tree's: noise was added or sequences were averaged. The nearest is marked.";
const equal = roots.every(i => edges[i].visits === edges[roots[0]].visits);
const measures = [["visits", "visits"], ["q", "Q"], ["prior", "prior"]];
let measure = equal ? "q" : "visits";
let shown = 16;
for (const [key, label] of measures) {
  const button = element("button", label);
  button.addEventListener("click", () => { measure = key; drawBars(); });
  button.dataset.measure = key;
  $("measures").append(button);
}
function drawBars() {
  for (const button of $("measures").children) {
    button.setAttribute("aria-pressed", String(button.dataset.measure === measure));
  }
  const order = [...roots].sort((a, b) => edges[b][measure] - edges[a][measure] || better(a, b));
  const values = roots.map(i => edges[i][measure]);
  const low = Math.min(0, ...values), high = Math.max(0, ...values), span = high - low || 1;
  const at = x => 100 * (x - low) / span;
  const list = order.slice(0, shown).map(i => {
    const item = element("li", undefined, i === data.chosen_edge ? "chosen" : "");
    const button = element("button");
    const value = edges[i][measure];
    const track = element("span", undefined, "track");
    const fill = element("span", undefined, "fill");
    fill.style.left = Math.min(at(0), at(value)) + "%";
    fill.style.width = Math.abs(at(value) - at(0)) + "%";
    const zero = element("span", undefined, "zero");
    zero.style.left = at(0) + "%";
    track.append(fill, zero);
    const name = element("span", action(edges[i].action, 4), "name");
    name.title = action(edges[i].action, 100);
    button.append(name, track, element("span", number(value), "number"));
    button.setAttribute("aria-label", `action ${action(edges[i].action, 4)}, ${measure} ${number(value)}` +
      (i === data.chosen_edge ? ", played" : "") + "; show in the tree");
    button.addEventListener("click", () => { select(i); rowOf(i).scrollIntoView({block: "nearest"}); rowOf(i).focus(); });
    item.append(button);
    return item;
  });
  $("bars").replaceChildren(...list);
  $("more").hidden = roots.length <= 16;
  $("more").textContent = shown < roots.length ? `Show all ${roots.length}` : "Show fewer";
}
$("more").addEventListener("click", () => { shown = shown < roots.length ? roots.length : 16; drawBars(); });

// --- the tree: rows of the visible edges; children are made when opened
const open = new Set();
const whole = new Set();  // parents whose every child is shown
const kMost = 100;
let selected = data.chosen_edge;
function visible() {
  const rows = [];
  const walk = (parent, level) => {
    const all = childrenOf(parent);
    const count = whole.has(parent) ? all.length : Math.min(kMost, all.length);
    const list = all.slice(0, count);
    if (level === 1 && selected >= 0 && edges[selected].parent === parent && !list.includes(selected)) list.push(selected);
    for (const i of list) {
      rows.push({edge: i, level});
      if (open.has(i)) walk(i, level + 1);
    }
    if (count < all.length) rows.push({rest: parent, level, count: all.length - count});
  };
  walk(-1, 1);
  return rows;
}
const rowOf = i => document.getElementById("edge" + i);
function drawTree() {
  const rows = visible().map(({edge: i, level, rest, count}) => {
    const row = element("tr");
    row.setAttribute("role", "row");
    row.setAttribute("aria-level", level);
    row.tabIndex = -1;
    const first = element("td");
    first.setAttribute("role", "gridcell");
    first.style.paddingLeft = `${0.4 + 1.1 * (level - 1)}rem`;
    if (rest !== undefined) {
      first.colSpan = 7;
      first.textContent = `${count} more …`;
      row.append(first);
      row.dataset.rest = rest;
      return row;
    }
    const edge = edges[i];
    row.id = "edge" + i;
    row.dataset.edge = i;
    const inner = childrenOf(i).length > 0;
    if (inner) row.setAttribute("aria-expanded", String(open.has(i)));
    row.setAttribute("aria-selected", String(i === selected));
    const twist = element("span", inner ? (open.has(i) ? "▾" : "▸") : "", "twist");
    twist.setAttribute("aria-hidden", "true");
    first.append(twist, action(edge.action, 3));
    if (i === data.chosen_edge) {
      row.className = "chosen";
      first.append(element("span", data.chosen_is_exact ? "played" : "nearest", "tag"));
    }
    row.append(first);
    const cells = [[edge.visits], [edge.visits ? edge.q : null], [edge.prior, "least"],
                   [edge.expanded ? edge.reward : null], [edge.expanded ? edge.discount : null, "least"],
                   [edge.expanded ? edge.value : null]];
    for (const [value, className] of cells) {
      const cell = element("td", number(value), className);
      cell.setAttribute("role", "gridcell");
      row.append(cell);
    }
    return row;
  });
  $("rows").replaceChildren(...rows);
  const current = rowOf(selected) || $("rows").firstElementChild;
  if (current) current.tabIndex = 0;
  drawDetail();
}
function drawDetail() {
  if (!(selected >= 0)) return;
  const edge = edges[selected];
  const line = [];
  for (let i = selected; i >= 0; i = edges[i].parent) line.push(i);
  const facts = [`transition ${line.length} from the root`, `N ${edge.visits}`];
  if (edge.visits) facts.push(`Q ${number(edge.q)}`);
  facts.push(`P ${number(edge.prior)}`);
  if (edge.expanded) {
    facts.push(`R ${number(edge.reward)}`, `γ ${number(edge.discount)}`, `v ${number(edge.value)}`);
  }
  const text = element("p", facts.join(", "), "soft");
  const list = element("ol");
  edge.action.forEach((x, k) => {
    const item = element("li");
    const track = element("span", undefined, "track");
    const fill = element("span", undefined, "fill");
    fill.style.left = 50 + 50 * Math.min(0, x) + "%";
    fill.style.width = 50 * Math.abs(x) + "%";
    track.append(fill, element("span", undefined, "zero"));
    item.append(element("span", "a" + (k + 1)), track, element("span", component(x), "number"));
    list.append(item);
  });
  $("detail").replaceChildren(text, list);
}
function select(i) {
  selected = i;
  for (let up = edges[i].parent; up >= 0; up = edges[up].parent) open.add(up);
  if (!childrenOf(edges[i].parent).slice(0, kMost).includes(i)) whole.add(edges[i].parent);
  drawTree();
}
function toggle(i, wanted) {
  if (childrenOf(i).length === 0) return;
  if (wanted ?? !open.has(i)) open.add(i); else open.delete(i);
}
$("rows").addEventListener("click", event => {
  const row = event.target.closest("tr");
  if (!row) return;
  if (row.dataset.rest !== undefined) { whole.add(Number(row.dataset.rest)); return drawTree(); }
  const i = Number(row.dataset.edge);
  toggle(i);
  select(i);
  rowOf(i).focus();
});
$("rows").addEventListener("keydown", event => {
  const row = event.target.closest("tr");
  if (!row) return;
  const go = target => {
    if (!target) return;
    if (target.dataset.edge !== undefined) { const i = Number(target.dataset.edge); select(i); target = rowOf(i); }
    target.focus();
    target.scrollIntoView({block: "nearest"});
  };
  const i = row.dataset.edge === undefined ? -1 : Number(row.dataset.edge);
  switch (event.key) {
    case "ArrowDown": go(row.nextElementSibling); break;
    case "ArrowUp": go(row.previousElementSibling); break;
    case "Home": go($("rows").firstElementChild); break;
    case "End": go($("rows").lastElementChild); break;
    case "ArrowRight":
      if (i >= 0 && !open.has(i)) { toggle(i, true); select(i); rowOf(i).focus(); } else go(row.nextElementSibling);
      break;
    case "ArrowLeft":
      if (i >= 0 && open.has(i)) { open.delete(i); select(i); rowOf(i).focus(); }
      else if (i >= 0 && edges[i].parent >= 0) go(rowOf(edges[i].parent));
      break;
    case "Enter": case " ": row.click(); break;
    default: return;
  }
  event.preventDefault();
});
function openMain() {
  for (let i = roots.includes(data.chosen_edge) ? data.chosen_edge : roots[0]; i !== undefined; i = childrenOf(i)[0]) open.add(i);
}
$("open-main").addEventListener("click", () => { openMain(); drawTree(); });
$("close-all").addEventListener("click", () => {
  open.clear();
  while (selected >= 0 && edges[selected].parent >= 0) selected = edges[selected].parent;
  drawTree();
});
openMain();
drawBars();
drawTree();
