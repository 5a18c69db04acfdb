"use strict";
// What the recording alone says of each episode: where each stands among the others, and all of them in a table.

const { looks, made } = JSON.parse(document.getElementById("data").textContent);
const into = (id, ...children) => document.getElementById(id).append(...children.flat().filter(Boolean));
const narrow = matchMedia("(max-width: 720px)").matches;
const odd = looks.filter((look) => look.odd.length);
const plural = (number, noun) => `${count(number)} ${noun}${number === 1 ? "" : "s"}`;

// Each measure: its name in the table, what it is, how it is written, and which words of the list of what is odd are about it.
const share = (value) => percent(value);
const MEASURES = [
  { key: "steps", name: "steps", meaning: "how many steps it lasts", write: (value) => count(value), words: ["long", "short"] },
  { key: "jerk", name: "jerk", meaning: "the median size of the third differences of its observations; smaller is smoother", write: significant, words: ["jerky"] },
  { key: "jerk_95", name: "jerk, 95 %", meaning: "the same at its 95th percentile: jerks in places", write: significant, words: ["jerky in places"], wide: true },
  { key: "arc_length", name: "arc length", meaning: "the spectral arc length of its speed; nearer to 0 is smoother", write: significant, words: ["many movements in one"], wide: true },
  { key: "fast_power", name: "fast", meaning: "the share of its power at periods of less than eight steps: shaking", write: share, words: ["shaky"], wide: true },
  { key: "still", name: "still", meaning: "the share of its steps that hardly move", write: share, words: ["stands still"] },
  { key: "jump", name: "jump", meaning: "its longest step, in median steps of the set", write: significant, words: ["jumps"], wide: true },
  { key: "outside", name: "outside", meaning: "the share of its actions' numbers outside [−1, 1]", write: share, words: [], wide: true },
  { key: "end_distance", name: "end off", meaning: "how far its last observation is from the median one of the set", write: significant, words: ["ends elsewhere"], wide: true },
];
const isOddBy = (look, measure) => look.odd.some((word) => measure.words.includes(word));
const valuesOf = (measure) => looks.map((look) => look[measure.key]).filter((value) => value != null);

function heading() {
  const doubles = looks.filter((look) => look.duplicate_of != null).length;
  const steps = looks.reduce((sum, look) => sum + look.steps, 0);
  into("top",
    el("h1", {}, "What do the recordings alone say?"),
    el("p", { class: "soft" }, `Set ${made.set}, stored as ${made.format}. This is a look at the data: it says what is unlike the rest, and not what an agent learns from it.`),
    made.why_not ? el("p", { class: "sentence" }, `Nobody can learn from this set: ${made.why_not}.${made.way_out ? ` What can be done: ${made.way_out}` : ""}`) : null,
    el("div", { class: "facts" },
      fact(plural(looks.length, "episode"), `with ${plural(steps, "step")} in all. An observation has ${plural(made.observation_size, "number")}, an action ${made.action_size}.`),
      fact(odd.length ? `${count(odd.length)} odd` : "Nothing odd", odd.length ? "stand first below, with what is unlike the others." : "No episode is far from the others by any of these measures."),
      fact(doubles ? plural(doubles, "duplicate") : "No duplicates", doubles ? "hold the same numbers as an earlier episode." : "Each episode has numbers of its own.")),
    [made.left_out, made.fits].filter(Boolean).map((text) => el("p", { class: "small" }, text)),
    made.numbers.length ? el("div", { class: "small", id: "numbers" },
      el("p", {}, "What set.toml says of the numbers:"),
      el("ul", {}, made.numbers.map((said) => el("li", {}, said)))) : null);
}

function fact(value, words) {
  return el("div", { class: "fact" }, el("b", {}, value), el("span", {}, words));
}

// A dot an episode along the range of a measure; the odd ones are named.
const MOST_DOTS = 1500;
function strip(measure) {
  const values = valuesOf(measure);
  if (values.length < 2) return null;
  const [low, high] = extent(values);
  const width = narrow ? 330 : 760;
  const right = linear([low, high], [10, width - 10]);
  const drawn = svg("svg", { viewBox: `0 0 ${width} 34`, role: "img", "aria-label": `${measure.name} of all episodes` },
    svg("line", { x1: 10, x2: width - 10, y1: 22, y2: 22, stroke: "var(--line)" }));
  const plain = looks.filter((look) => look[measure.key] != null && !isOddBy(look, measure));
  const every = Math.max(1, Math.ceil(plain.length / MOST_DOTS));
  for (const look of plain.filter((_, index) => index % every === 0)) {
    drawn.append(svg("circle", { cx: right(look[measure.key]), cy: 22, r: 4, fill: "var(--ours)", "fill-opacity": 0.35 }));
  }
  const named = [];
  for (const look of looks.filter((look) => look[measure.key] != null && isOddBy(look, measure))) {
    const cx = right(look[measure.key]);
    drawn.append(svg("circle", { cx, cy: 22, r: 5, fill: "var(--other)" }, svg("title", {}, `episode ${look.label}: ${measure.write(look[measure.key])}`)));
    const half = 4 + 3.6 * look.label.length;
    const at = Math.min(Math.max(cx, half), width - half);
    if (named.every((other) => Math.abs(other.at - at) > half + other.half)) {
      named.push({ at, half });
      drawn.append(svg("text", { x: at, y: 11, "text-anchor": "middle", "font-size": 12 }, look.label));
    }
  }
  // The axis is wider than the numbers where they are all the same.
  const sorted = [...values].sort((one, other) => one - other);
  const [least, most] = [sorted[0], sorted.at(-1)].map(measure.write);
  const between = least === most ? least : `${least} to ${most}`;
  return el("figure", { style: "margin:10px 0" },
    el("h3", {}, measure.name, " ", el("span", { class: "small soft", style: "font-weight:400" }, `${measure.meaning}: ${between}`)),
    drawn);
}

function spread() {
  if (looks.length < 2) return;
  into("spread",
    el("h2", {}, "Where each stands among the others"),
    el("p", { class: "soft" }, "A dot is an episode. Orange ones are far from the median of the set (3.5 deviations, of five episodes or more) and carry their name."),
    MEASURES.map(strip));
}

const FIRST = 200;
function episodes() {
  const body = el("tbody");
  const head = el("tr");
  let order = null;
  const columns = [
    { name: "episode", left: true, of: (look) => look.label, show: (look) => look.label },
    ...MEASURES.map((measure) => ({
      name: measure.name, wide: measure.wide, of: (look) => look[measure.key], title: measure.meaning,
      show: (look) => (look[measure.key] == null ? "–" : measure.write(look[measure.key])), far: (look) => isOddBy(look, measure),
    })),
    { name: "odd", left: true, words: true, of: (look) => -look.oddness, show: (look) => look.odd.join(", ") },
  ];
  // In a narrow window the words would stand outside of it.
  if (narrow) columns.splice(1, 0, columns.pop());
  const more = el("button", { on: { click: () => fill(looks.length) } });
  function fill(most) {
    const sorted = [...looks];
    if (order) {
      const key = (look) => order.column.of(look) ?? -Infinity;
      const compare = (a, b) => (typeof a === "string" ? a.localeCompare(b, "en", { numeric: true }) : a - b);
      sorted.sort((a, b) => order.sign * compare(key(a), key(b)));
    }
    body.replaceChildren(...sorted.slice(0, most).map((look) => el("tr", { class: look.odd.length ? "kept" : null },
      columns.map((column) => el("td", {
        class: [column.left ? "left" : "", column.wide ? "wide" : "", column.far?.(look) ? "far" : ""].join(" ").trim() || null,
        style: column.words ? "white-space:normal;min-width:8.5em" : null,
      }, column.show(look))))));
    more.textContent = `Show all ${count(looks.length)}`;
    more.hidden = looks.length <= most;
  }
  head.append(...columns.map((column) => el("th", { class: [column.left ? "left" : "", column.wide ? "wide" : ""].join(" ").trim() || null },
    el("button", { class: "link", title: column.title ?? "sort", on: { click: () => {
      order = { column, sign: order?.column === column ? -order.sign : column.left ? 1 : -1 };
      fill(more.hidden ? looks.length : FIRST);
    } } }, column.name))));
  fill(FIRST);
  into("episodes",
    el("h2", {}, "Each episode"),
    el("p", { class: "soft" }, "The oddest first. A click on a heading sorts by it."),
    el("div", { class: "scroll" }, el("table", { id: "looks" }, el("thead", {}, head), body)), more);
}

function meaning() {
  into("meaning",
    el("h2", {}, "What the numbers are"),
    el("p", { class: "small" }, "Observations are taken in units of their standard deviation over the set, those that never vary left out. An episode from which nobody can learn has no numbers."),
    MEASURES.map((measure) => el("p", { class: "small" }, el("b", {}, measure.name), `: ${measure.meaning}.`)));
  into("foot", el("p", {}, `Written by demosift ${made.demosift}. This page is one file and needs no network; \`demosift inspect SET --json\` has the same numbers.`));
}

heading();
spread();
episodes();
meaning();
