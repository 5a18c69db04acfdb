"use strict";
// The page from top to bottom, but for the replay.

const { report, made, replay } = JSON.parse(document.getElementById("data").textContent);
const unit = report.unit ? ` ${report.unit}` : "";
const inUnit = (name) => (report.unit ? `${name} [${report.unit}]` : name);
const into = (id, ...children) => document.getElementById(id).append(...children.flat().filter(Boolean));
const placeOf = new Map(report.entries.map((entry, place) => [entry.demo, place + 1]));
const several = report.variants.length > 1;
const scoreDecimals = decimalsFor(report.entries.flatMap((entry) => [entry.after, entry.after - entry.gain]));
// Of a large set not all are looked at.
const looked = replay.demos ? new Set(replay.demos) : null;
const isLooked = (demo) => !looked || looked.has(demo);
// Pictures take more room than poses, so fewer demonstrations are filmed.
const filmed = replay.films.length ? new Set(replay.films.map((film) => film.demo)) : null;
const isPlayed = (demo) => isLooked(demo) && (!filmed || filmed.has(demo));
const whichLooked = looked ? ` Of the ${count(report.entries.length)} demonstrations these are ${looked.size}: the best, the worst, and those near the cut.` : "";
const keptDemos = report.entries.filter((entry) => entry.kept).map((entry) => entry.demo);
// Nobody reads a list of hundreds; the table below has them all.
function listed(demos) {
  const sorted = [...demos].sort((a, b) => a - b);
  return sorted.length > 40 ? `${sorted.slice(0, 12).join(", ")} and ${count(sorted.length - 12)} more` : sorted.join(", ");
}

const STAGES = {
  meta_train: "learning to imitate", pre_train: "imitating the entire set",
  judge_cloning: "judging by cloning", judge_paper: "judging by the paper's judge", judge_trainer: "judging by your own trainer", subset_selection: "weighing",
  referee: "final policies, several each", imitate_subset: "from scratch, the kept", imitate_all: "from scratch, all",
};

// Commands stand between backticks.
function withCommands(text) {
  return text.split("`").map((part, index) => (index % 2 ? el("code", {}, part) : part));
}

function fact(value, words) {
  return el("div", { class: "fact" }, el("b", {}, value), el("span", {}, withCommands(words)));
}

const CONCLUSIONS = {
  helps: "Selecting helps", fewer_helps: "Fewer help, no matter which", cannot_tell: "It cannot be told",
  does_not_help: "Take the whole set", nothing_to_compare: "Nothing to compare",
};

function concluded() {
  const { verdict } = report;
  if (verdict?.conclusion === "nothing_to_compare") return fact(CONCLUSIONS[verdict.conclusion], "since all were kept, or fewer than three final policies were trained on a side.");
  if (verdict) return fact(CONCLUSIONS[verdict.conclusion], "is what final policies say, several trained on each side.");
  return fact("Not tried yet", "whether policies from the kept are better than those from all: `demosift referee --resume` finds out");
}

// What the verdict says to train on.
function recommended() {
  const { winner, pairs, candidates } = report.verdict ?? {};
  return winner == null ? null : candidates[pairs[winner].candidate].demos;
}

function heading() {
  const number = report.entries.length;
  const best = report.entries[0];
  into("top",
    el("h1", {}, `Which of these ${number} demonstrations teach the agent?`),
    el("p", { class: "soft" }, `Task ${report.task}${made.variant ? ` under ${made.variant}` : ""}, set ${made.set}. Each demonstration was imitated, and the agent was then scored by the task's own heuristic; higher is better.`),
    report.verdict ? el("p", { class: "sentence" }, report.verdict.sentence) : null,
    el("div", { class: "facts" },
      recommended()
        ? fact(`Train on ${recommended().length} of ${number}`, `${recommended().length === number ? "All of them" : `Demonstration${recommended().length === 1 ? "" : "s"} ${listed(recommended())}`}, as the referee says.`)
        : made.goals.length ? fact(`${made.goals.length} goals`, "Each goal has a ranking and a page of its own; this page shows the mean over goals, which selects nothing.")
        : report.has_subset ? fact(`Keep ${keptDemos.length} of ${number}`, `Demonstration${keptDemos.length === 1 ? "" : "s"} ${listed(keptDemos)} (asked for: ${report.keep}).`)
        : fact("Nothing kept yet", "`demosift select --resume` chooses a subset"),
      fact(`${signed(best.gain, scoreDecimals)}${unit}`, `is what the best one, demonstration ${best.demo}, brings: from ${fixed(report.before, scoreDecimals)} before imitating it to ${fixed(best.after, scoreDecimals)} after.`),
      made.goals.length ? null : concluded()),
    made.goals.length ? el("p", { id: "goals" }, "The goals: ", made.goals.flatMap(({ name, page }, index) => [index ? ", " : "", page ? el("a", { href: page }, name) : name]), ".") : null);
}

function remarks() {
  const level = percent(report.level);
  const said = [report.groups > 1
    ? `Lines divide ${report.groups} groups: a group holds what cannot be told from its best one, by the ${level} interval of their difference.`
    : "Not separable: this budget can tell no demonstration from the best, so their order may be chance."];
  if (report.caveat) said.push(report.caveat);
  const useless = report.entries.filter((entry) => entry.kept && entry.gain <= 0).map((entry) => entry.demo);
  if (useless.length) said.push(`Kept although imitating it did not make the agent better: ${listed(useless)}.`);
  if (report.keep === "auto" && report.entries.some((entry) => entry.kept && entry.improves < report.level))
    said.push(`Nothing surely helps: no demonstration makes the agent better with a probability of ${level}; kept were those that may be the best.`);
  if (report.top_set != null) said.push(`That the first ${report.k} are the ${report.k} best has a probability of ${percent(report.top_set)}.`);
  return said.map((text) => el("p", { class: "small" }, text));
}

function ranking() {
  const { entries } = report;
  const [low, high] = extent(entries.flatMap((entry) => [entry.low, entry.high, 0]));
  const pad = (high - low) * 0.03;
  const domain = [low - pad, high + pad];
  const narrow = matchMedia("(max-width: 720px)").matches;
  const width = narrow ? 118 : 260;
  const shows = replay.episodes.length + replay.films.length > 0;
  const head = el("tr", {},
    el("th", {}, narrow ? "" : "rank"), el("th", { class: "left" }, narrow ? "demo" : "demonstration"), el("th", { class: "wide" }, "steps"),
    el("th", { class: "wide" }, inUnit("after")), el("th", {}, inUnit("gain")),
    el("th", { class: "left" }, `${percent(report.level)} interval`, intervalAxis(domain, width)),
    el("th", {}, `P(top ${report.k})`), el("th", { class: "wide" }, "P(helps)"), el("th", { class: "left" }));
  const rows = entries.map((entry, place) => el("tr", {
    class: [entry.kept ? "kept" : "", place && entries[place - 1].group !== entry.group ? "newgroup" : ""].join(" ").trim() || null,
  },
    el("td", {}, `${place + 1}`),
    el("td", { class: "left" }, shows && isPlayed(entry.demo)
      ? el("button", { class: "link", title: "replay it", on: { click: () => window.showDemonstration?.(entry.demo) } }, `${entry.demo}`)
      : `${entry.demo}`),
    el("td", { class: "wide" }, `${entry.steps}`),
    el("td", { class: "wide" }, fixed(entry.after, scoreDecimals)),
    el("td", {}, signed(entry.gain, scoreDecimals)),
    el("td", { title: `${signed(entry.low, scoreDecimals)} to ${signed(entry.high, scoreDecimals)}` },
      intervalRow({ low: entry.low, at: entry.gain, high: entry.high, kept: entry.kept }, domain, width)),
    el("td", {}, percent(entry.top), narrow ? null : bar(entry.top, 46)),
    el("td", { class: "wide" }, percent(entry.improves)),
    el("td", { class: "left" }, entry.kept ? el("span", { class: "tag" }, narrow ? "✓" : "kept") : "")));
  into("ranking",
    el("h2", {}, "Ranking"),
    el("p", { class: "soft" }, `How much better imitating each demonstration makes the agent. The upright line is the agent as it was before (${fixed(report.before, scoreDecimals)}${unit}).`),
    el("div", { class: "scroll" }, el("table", { id: "places" }, el("thead", {}, head), el("tbody", {}, rows))),
    remarks());
}

const TRAINER = (report.judges.find((one) => one.trainer)?.trainer ?? report.verdict?.trainer)?.name ?? "trainer";
const JUDGES = { cloning: "the judge by cloning", paper: "the judge of the paper", trainer: `the judge by ${TRAINER}` };
const NO_VOTE = {
  disagrees_with_itself: "its repeats agree with each other no better than chance, so imitating by it taught the agent nothing that can be told apart here",
  taught_nothing: "imitating by it surely made the agent better for no demonstration",
};

function judges() {
  const { judges, entries, agreement, disagreements } = report;
  const correlation = (value) => (value == null ? "unknown" : fixed(value, 2));
  const said = judges.filter((one) => NO_VOTE[one.vote]).map((one) => `No vote for ${JUDGES[one.judge]}: ${NO_VOTE[one.vote]}.`);
  for (const { judge } of judges) {
    const demos = disagreements.filter((one) => one.kept_by === judge).map((one) => one.demo);
    const other = judges.find((one) => one.judge !== judge);
    if (demos.length) said.push(`They clearly disagree about ${listed(demos)}: ${JUDGES[judge]} is sure that it belongs to the best, and ${JUDGES[other.judge]} that it does not. The replay shows what each imitation did.`);
  }
  if (judges.length < 2 && !said.length) return;
  const disputed = new Set(disagreements.map((one) => one.demo));
  const cells = (one) => one == null ? [el("td", {}, "–"), el("td", {}, "–"), el("td", { class: "left wide" }, "–")] : [
    el("td", {}, `${one.place}`), el("td", {}, signed(one.gain, scoreDecimals)),
    el("td", { class: "left wide" }, `${signed(one.low, scoreDecimals)} to ${signed(one.high, scoreDecimals)}`)];
  const rows = entries.map((entry) => el("tr", { class: entry.kept ? "kept" : null },
    el("td", { class: "left" }, `${entry.demo}`), entry.by_judge.flatMap(cells),
    el("td", { class: "left" }, disputed.has(entry.demo) ? el("span", { class: "tag" }, "disputed") : "")));
  const heads = judges.flatMap((one) => [el("th", {}, `place by ${one.judge}`), el("th", {}, inUnit("gain")), el("th", { class: "left wide" }, `${percent(report.level)} interval`)]);
  const deciders = judges.filter((one) => one.decides);
  const order = deciders.length > 1 ? "by the mean of both gains" : `that of ${JUDGES[deciders[0].judge]}`;
  for (const one of judges.filter((one) => one.judged < entries.length))
    said.unshift(`Of the ${entries.length} demonstrations ${JUDGES[one.judge]} judged the ${one.judged} nearest to the cut, and its places are among these.`);
  into("judges",
    el("h2", {}, judges.length > 1 ? "What each judge says" : "The judge"),
    judges.length > 1 ? el("p", { class: "soft" }, `The order is ${order}. Rank correlation between the two judges: ${correlation(agreement)}; of each with itself, from one repeat to the others: ${judges.map((one) => `${JUDGES[one.judge]} ${correlation(one.agrees_with_itself)}`).join(", ")}.`) : null,
    said.map((text) => el("p", { class: "small" }, text)),
    judges.length > 1 ? el("div", { class: "scroll" }, el("table", {},
      el("thead", {}, el("tr", {}, el("th", { class: "left" }, "demonstration"), heads, el("th", {}))), el("tbody", {}, rows))) : null);
}

function variants() {
  if (!several) return;
  const best = report.variants.map((_, variant) => Math.max(...report.entries.map((entry) => entry.by_variant[variant])));
  const rows = report.entries.map((entry) => el("tr", { class: entry.kept ? "kept" : null },
    el("td", { class: "left" }, `${entry.demo}`),
    entry.by_variant.map((gain, variant) => el("td", gain === best[variant] ? { style: "font-weight:700" } : {},
      signed(gain, scoreDecimals), gain === best[variant] ? " ★" : ""))));
  into("variants",
    el("h2", {}, "Gain under each variant"),
    el("p", { class: "soft" }, `${inUnit("Gain")}; ★ marks the best demonstration of a variant. The ranking takes the mean.`),
    el("div", { class: "scroll" }, el("table", {},
      el("thead", {}, el("tr", {}, el("th", { class: "left" }, "demonstration"), report.variants.map((name) => el("th", {}, name)))),
      el("tbody", {}, rows))));
}

// The episodes that a replay plays side by side.
function episodesBeside(withDemonstration) {
  const demonstration = withDemonstration ? [{ name: "Demonstration", part: "demonstration", judge: null }] : [];
  // The policies of somebody's own trainer are not kept.
  const kept = report.judges.filter((one) => one.judge !== "trainer");
  if (!kept.length) return demonstration;
  const decider = (kept.find((one) => one.decides) ?? kept[0]).judge;
  const after = kept.map(({ judge }) => ({ name: kept.length > 1 ? `Agent after, by ${judge}` : "Agent after", part: "after", judge }));
  return [...demonstration, { name: "Agent before", part: "before", judge: decider }, ...after];
}

// What stands above an episode.
function episodeInWords({ score, succeeded, steps }) {
  const said = [score == null ? null : `${fixed(score, scoreDecimals)}${unit}`];
  if (succeeded != null) said.push(succeeded ? "reaches the goal" : "misses the goal");
  // Where episodes can end early, a score means little without the length.
  if (steps < report.horizon) said.push(`${steps} of ${report.horizon} steps`);
  return said.filter(Boolean).join(" · ");
}

const IMITATORS = { behavioral_cloning: "cloning", gail: "GAIL", trainer: TRAINER };

// What is trained on, as the rows of the picture name it.
function candidateName({ names, side, size }) {
  if (side === "whole") return `all ${size}`;
  if (side === "random") return `random ${size}`;
  return `${size} ${names.join(", ")}`;
}

function verdict() {
  const found = report.verdict;
  if (!found?.pairs.length) return;
  const scores = found.pairs.flatMap((pair) => pair.trainings.map((training) => training.outcome.score));
  const [low, high] = extent([...scores, ...found.pairs.flatMap((pair) => [pair.low ?? pair.mean, pair.high ?? pair.mean])]);
  const pad = (high - low) * 0.04;
  const domain = [low - pad, high + pad];
  const narrow = matchMedia("(max-width: 720px)").matches;
  const width = narrow ? 120 : 300;
  const decimals = decimalsFor(scores);
  const remark = (pair, index) => index === found.winner ? el("span", { class: "tag" }, narrow ? "✓" : "train on this")
    : pair.dropped ? "dropped early" : found.compared && !pair.is_compared ? "shown only" : "";
  const color = { kept: "var(--ours)", whole: "var(--other)", random: "var(--soft)" };
  const knowsSuccess = found.pairs.some((pair) => pair.success != null);
  const row = (pair, index) => {
    const candidate = found.candidates[pair.candidate];
    return el("tr", { class: index === found.winner ? "kept" : null },
      el("td", { class: "left" }, candidateName(candidate)), el("td", { class: "left" }, IMITATORS[pair.imitator]),
      el("td", { class: "wide" }, `${pair.trainings.length}`), el("td", {}, fixed(pair.mean, decimals)),
      el("td", { class: "left", title: pair.low == null ? "one training" : `${fixed(pair.low, decimals)} to ${fixed(pair.high, decimals)}` },
        dotRow({ ...pair, scores: pair.trainings.map((training) => training.outcome.score), color: color[candidate.side] }, domain, width)),
      knowsSuccess ? el("td", { class: "wide" }, percent(pair.success)) : null,
      el("td", { class: "left wide" }, remark(pair, index)));
  };
  const limits = found.compared > 1 ? ` The level is divided by the ${found.compared} kept pairs that are compared.` : "";
  into("verdict",
    el("h2", {}, "What to train on"),
    el("p", { class: "soft" }, `Final policies from scratch, one dot per training: its best policy on episodes that did not choose it. The bar is the 95 % interval of the mean over trainings. Random subsets are others in each training. Where nothing is gained, a run says that selecting helps in at most ${percent(found.level)} of cases.${limits}`),
    el("div", { class: "scroll" }, el("table", {},
      el("thead", {}, el("tr", {}, el("th", { class: "left" }, "policies from"), el("th", { class: "left" }, "by"), el("th", { class: "wide" }, "trainings"),
        el("th", {}, inUnit("heuristic")), el("th", { class: "left" }, axisRow(domain, width)), knowsSuccess ? el("th", { class: "wide" }, "success") : null, el("th", { class: "left wide" }))),
      el("tbody", {}, found.pairs.map(row)))));
}

function learning() {
  const found = report.learning;
  if (!found) return;
  // Cloning learns from no environment step, so its curves go by updates.
  const bySteps = [...found.subset, ...found.all].some((point) => point.environment_steps > 0);
  const points = (curve) => curve.map((point) => [bySteps ? point.environment_steps : point.updates, point.score, point.score - point.standard_error, point.score + point.standard_error]);
  const chart = lineChart({
    series: [
      { name: `all ${report.entries.length}`, color: "var(--other)", band: "var(--otherband)", dash: "7 4", points: points(found.all) },
      { name: `the ${keptDemos.length} kept`, color: "var(--ours)", points: points(found.subset), strong: true },
    ],
    width: 900, height: 300, labels: true, xName: bySteps ? "environment steps learned from" : "updates",
    yName: inUnit("heuristic"), summary: "Learning curves of the policy from the kept demonstrations and of the one from all",
  });
  const decimals = decimalsFor([found.from_subset.score, found.from_all.score]);
  const row = (name, point) => el("tr", {}, el("td", { class: "left" }, name),
    el("td", {}, fixed(point.score, decimals)), el("td", {}, `± ${fixed(point.standard_error, decimals)}`),
    el("td", {}, percent(point.success)), el("td", {}, count(point.environment_steps)));
  into("learning",
    el("h2", {}, "One policy each from scratch"),
    el("p", { class: "soft" }, "Two policies with the same budget: one imitates the kept demonstrations, the other all of them. The bands are one standard error over the evaluation's episodes. One training each says little: another would move both."),
    el("div", { class: "chart" }, chart),
    el("div", { class: "scroll" }, el("table", {},
      el("thead", {}, el("tr", {}, el("th", { class: "left" }, "best policy from"), el("th", {}, inUnit("heuristic")), el("th", {}, "standard error"), el("th", {}, "success"), el("th", {}, "learned from, steps"))),
      el("tbody", {}, row(`the kept (${listed(keptDemos)})`, found.from_subset), row("all", found.from_all)))));
}

function adaptation() {
  const curves = report.curves.filter((curve) => curve.score.length || curve.accuracy.length);
  if (!curves.length) return;
  const distance = report.judges.find((one) => one.judge === curves[0].judge).adapted_behaviors_distance;
  const ys = extent(curves.flatMap((curve) => [...curve.score.flatMap((band) => [band.low, band.high]), curve.before, curve.after]));
  const place = el("div", { class: "multiples" });
  const points = (bands) => bands.map((band, update) => [update, band.mean, band.low, band.high]);
  function show(variant) {
    place.replaceChildren(...report.entries.filter((entry) => isLooked(entry.demo)).map((entry) => {
      const curve = curves.find((one) => one.demo === entry.demo && one.variant === variant);
      if (!curve) return el("figure", {});
      const [color, band] = entry.kept ? ["var(--ours)", "var(--band)"] : ["var(--soft)", "var(--faint)"];
      const xs = [0, Math.max(1, curve.score.length, curve.accuracy.length)];
      return el("figure", {},
        el("h3", {}, `${placeOf.get(entry.demo)}. demonstration ${entry.demo} `, entry.kept ? el("span", { class: "tag" }, "kept") : null),
        curve.score.length ? lineChart({
          // The last point is the agent that came out, which was evaluated and not only played.
          series: [{ color, band, points: [...points(curve.score), [curve.score.length, curve.after, curve.after, curve.after]] }],
          levels: [{ at: curve.before }], width: 230, height: 130, x: xs, y: ys, whole: true,
          summary: `Heuristic while imitating demonstration ${entry.demo}`,
        }) : null,
        curve.accuracy.length ? lineChart({
          series: [{ color: "var(--other)", band: "var(--otherband)", points: points(curve.accuracy), stroke: 1.5 }],
          levels: [{ at: 0.5 }], width: 230, height: 78, x: xs, y: [0.4, 1], whole: true,
          summary: `Accuracy of the discriminator of demonstration ${entry.demo}`,
        }) : null);
    }));
  }
  into("adaptation",
    el("h2", {}, "How each adaptation went"),
    el("p", { class: "soft" }, `Above: the heuristic${unit ? ` in${unit}` : ""} over the updates, the mean and the range of the repeats; the dotted line is the agent before. Below: which share the discriminator told right; at 0.5 it cannot tell the agent from the demonstration, at 1 it always can. The adapted agents are ${significant(distance)} away from what was demonstrated (adapted behaviors distance, the mean of the set).${whichLooked}`),
    several ? el("div", { class: "controls" }, el("label", {}, "Variant", el("select", { on: { change: (event) => show(Number(event.target.value)) } },
      report.variants.map((name, variant) => el("option", { value: variant }, name))))) : null,
    place);
  show(0);
}

function weights() {
  const trends = report.weights;
  if (!trends?.rounds.length) return;
  // A round holds the weights of those that take part, which need not be all of the file.
  const place = new Map(report.entries.map((entry) => entry.demo).sort((a, b) => a - b).map((demo, index) => [demo, index]));
  const series = report.entries.map((entry) => ({
    name: `${entry.demo}${trends.demos.includes(entry.demo) ? " kept" : ""}`, strong: trends.demos.includes(entry.demo),
    color: trends.demos.includes(entry.demo) ? "var(--ours)" : "var(--soft)", dash: trends.demos.includes(entry.demo) ? null : "3 3",
    points: [[0, 1], ...trends.rounds.map((round, index) => [index + 1, round[place.get(entry.demo)]])],
  }));
  into("weights",
    el("h2", {}, "Weights, round by round"),
    el("p", { class: "soft" }, trends.end === "converged"
      ? "Demonstrations that help count more and more, the others less. It ended as the subset no longer changed."
      : "Demonstrations that help count more and more, the others less. It ended at the limit of rounds, before the same subset had come out often enough in a row."),
    el("div", { class: "chart" }, lineChart({ series, width: 900, height: 320, labels: true, xName: "round", yName: "weight", whole: true, summary: "Weight of each demonstration over the rounds" })));
}

function columns() {
  const columns = report.own_heuristic ? [...report.data_only, report.own_heuristic] : report.data_only;
  if (!columns.length) return;
  const number = report.entries.length;
  // A third of the set away is far: about what two unrelated rankings differ by on average.
  const far = (place, column) => column.spearman != null && Math.abs(column.places[place] - (place + 1)) >= number / 3;
  const rows = report.entries.map((entry, place) => el("tr", {},
    el("td", {}, `${place + 1}`), el("td", { class: "left" }, `${entry.demo}`),
    columns.map((column) => el("td", { class: far(place, column) ? "far" : null, title: `place ${significant(column.places[place])} of ${number}` },
      significant(column.scores[place]), far(place, column) ? (column.places[place] > place + 1 ? " ▼" : " ▲") : ""))));
  rows.push(el("tr", {}, el("td", {}), el("td", { class: "left" }, "Spearman with the gain"),
    columns.map((column) => el("td", { style: "font-weight:650" }, column.spearman == null ? "–" : signed(column.spearman, 2)))));
  into("opinions",
    el("h2", {}, "What the recordings alone say"),
    el("p", { class: "soft" }, "Scorers that look at the data and try nothing; higher is better by their own lights. None of it enters the ranking. ▲ stands where a scorer would place a demonstration at least a third of the set higher than trying it does, ▼ where lower."),
    made.unusable ? el("p", { class: "small" }, `The demonstrations' own heuristic is not known: ${made.unusable}`) : null,
    el("div", { class: "scroll" }, el("table", {},
      el("thead", {}, el("tr", {}, el("th", {}, "rank"), el("th", { class: "left" }, "demonstration"), columns.map((column) => el("th", { title: column.meaning }, column.name)))),
      el("tbody", {}, rows))),
    el("details", {}, el("summary", { class: "small" }, "What each number is"),
      columns.map((column) => el("p", { class: "small" }, el("b", {}, column.name), `: ${column.meaning}`))));
}

function costs() {
  const { stages, quota, of_quota, account } = report.costs;
  if (!stages.length) return;
  const most = Math.max(...stages.map(([, steps]) => steps));
  into("costs",
    el("h2", {}, "What it cost"),
    el("p", { class: "soft" }, `In environment steps.${report.judges.some((one) => one.judge === "paper") ? ` Every method may spend ${count(quota)} on learning to imitate and judging; ${report.method} spent ${count(of_quota)} of them.` : ""}`),
    account ? el("p", { class: "soft" }, `By the judge of the paper ${count(account.once)} are paid once, and ${count(account.each)} for each demonstration.`) : null,
    el("div", { class: "scroll" }, el("table", {}, el("tbody", {}, stages.map(([stage, steps]) => el("tr", {},
      el("td", { class: "left" }, STAGES[stage] ?? (stage.startsWith("imitate_subset_keep_") ? STAGES.imitate_subset : stage)), el("td", {}, count(steps)), el("td", { class: "left", style: "width:55%" }, bar(steps / most, 260))))))));
}

function configuration() {
  into("configuration",
    el("h2", {}, "How it was made"),
    el("p", { class: "small" }, `demosift ${made.demosift}, method ${report.method}, task ${report.task}${made.variant ? ` under ${made.variant}` : ""}: episodes of at most ${report.horizon} control steps of ${significant(report.control_step_secs)} s. Set ${made.set}, SHA-256 ${made.sha256.slice(0, 16)}….${made.left_out ? ` ${made.left_out}` : ""}`),
    made.numbers.length ? el("div", { class: "small", id: "numbers" },
      el("p", {}, "The numbers of the set are not those of the task; its set.toml says what they are:"),
      el("ul", {}, made.numbers.map((said) => el("li", {}, said)))) : null,
    el("details", {}, el("summary", {}, "Configuration"), el("pre", {}, made.configuration)));
  into("foot", el("p", {}, "This page is one file and needs no network. The numbers are also in the JSON files of the run folder."),
    replay.episodes.length ? el("details", {}, el("summary", {}, "The replay is drawn by three.js, under its license"), el("pre", {}, document.getElementById("license").textContent)) : null);
}

heading();
ranking();
judges();
verdict();
variants();
learning();
adaptation();
weights();
columns();
costs();
configuration();
