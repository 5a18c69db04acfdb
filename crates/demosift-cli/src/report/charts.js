"use strict";
// Elements and small charts. Text is always set as text, never as markup.

function el(name, attributes, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes ?? {})) {
    if (key === "on") for (const [event, act] of Object.entries(value)) made.addEventListener(event, act);
    else if (value === true) made.setAttribute(key, "");
    else if (value !== false && value != null) made.setAttribute(key, value);
  }
  made.append(...children.flat().filter((child) => child != null && child !== false));
  return made;
}

function svg(name, attributes, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes ?? {})) if (value != null) made.setAttribute(key, value);
  made.append(...children.flat().filter((child) => child != null));
  return made;
}

// Decimals that suit the size of the numbers, as the command's tables have them.
function decimalsFor(values) {
  const largest = values.filter(Number.isFinite).reduce((most, value) => Math.max(most, Math.abs(value)), 0);
  if (largest >= 10) return largest >= 1000 ? 0 : largest >= 100 ? 1 : 2;
  return largest >= 0.1 || largest < 1e-12 ? 3 : 2 - Math.floor(Math.log10(largest));
}

const MINUS = "\u2212";
function fixed(value, decimals) {
  if (value == null || !Number.isFinite(value)) return "–";
  const written = Math.abs(value).toFixed(decimals);
  return (value < 0 && Number(written) !== 0 ? MINUS : "") + written;
}
function signed(value, decimals) {
  const written = fixed(value, decimals);
  return value >= 0 && written !== "–" ? `+${written}` : written;
}
function significant(value) {
  const size = Math.abs(value);
  return fixed(value, size >= 100 || Number.isInteger(value) ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3);
}
// With a space at which no line breaks.
function percent(share) {
  return share == null ? "–" : `${Math.round(share * 100)}\u00a0%`;
}
function count(number) {
  return number.toLocaleString("en-US");
}

function extent(values) {
  const finite = values.filter(Number.isFinite);
  // Not by spreading: a large set has more numbers than a call may have arguments.
  let [low, high] = finite.reduce(([least, most], value) => [Math.min(least, value), Math.max(most, value)], [Infinity, -Infinity]);
  if (!(high > low)) [low, high] = [low - 0.5, high + 0.5];
  return [low, high];
}

// Round numbers that span an interval.
function ticks([low, high], about) {
  const rough = (high - low) / about;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((size) => size >= rough) ?? rough;
  const found = [];
  for (let tick = Math.ceil(low / step - 1e-9) * step; tick <= high + step * 1e-9; tick += step) found.push(tick);
  return { at: found, decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

function linear([from, to], [start, end]) {
  return (value) => start + ((value - from) / (to - from)) * (end - start);
}

function path(points) {
  return points.map(([x, y], index) => `${index ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("");
}

// A line chart: series of { name, color, dash, points: [[x, y, low, high]] }, named at their ends where `labels` says so.
function lineChart({ series, width, height, x, y, levels = [], labels = false, xName, yName, summary, whole = false }) {
  const compact = width < 300;
  const size = compact ? 11 : 13;
  const margin = { left: compact ? 38 : 56, right: labels ? 120 : 10, top: 10, bottom: xName ? 38 : 22 };
  const all = series.flatMap((one) => one.points);
  const xs = x ?? extent(all.map((point) => point[0]));
  const ys = y ?? extent([...all.flatMap((point) => point.slice(1)), ...levels.map((level) => level.at)]);
  const right = linear(xs, [margin.left, width - margin.right]);
  const up = linear(ys, [height - margin.bottom, margin.top]);
  const drawn = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": summary });
  const rows = ticks(ys, compact ? 3 : 5);
  for (const tick of rows.at) {
    drawn.append(
      svg("line", { x1: margin.left, x2: width - margin.right, y1: up(tick), y2: up(tick), stroke: "var(--faint)" }),
      svg("text", { x: margin.left - 6, y: up(tick) + size / 3, "text-anchor": "end", "font-size": size }, fixed(tick, rows.decimals)),
    );
  }
  const columns = ticks(xs, compact ? 4 : 6);
  for (const tick of columns.at) {
    if (whole && !Number.isInteger(tick)) continue;
    const written = Math.abs(tick) >= 10000 ? `${fixed(tick / 1000, 0)}k` : fixed(tick, whole ? 0 : columns.decimals);
    drawn.append(svg("text", { x: right(tick), y: height - margin.bottom + size + 4, "text-anchor": "middle", "font-size": size }, written));
  }
  drawn.append(svg("line", { x1: margin.left, x2: width - margin.right, y1: up(ys[0]), y2: up(ys[0]), stroke: "var(--line)" }));
  for (const level of levels) {
    drawn.append(svg("line", { x1: margin.left, x2: width - margin.right, y1: up(level.at), y2: up(level.at), stroke: "var(--soft)", "stroke-dasharray": "2 3" }));
  }
  if (xName) drawn.append(svg("text", { x: (margin.left + width - margin.right) / 2, y: height - 4, "text-anchor": "middle", "font-size": size }, xName));
  if (yName) drawn.append(svg("text", { x: -(height - margin.bottom) / 2, y: 12, transform: "rotate(-90)", "text-anchor": "middle", "font-size": size }, yName));
  const ends = [];
  for (const one of series) {
    if (!one.points.length) continue;
    if (one.points[0].length > 2) {
      const upper = one.points.map((point) => [right(point[0]), up(point[3])]);
      const lower = one.points.map((point) => [right(point[0]), up(point[2])]).reverse();
      drawn.append(svg("path", { d: `${path([...upper, ...lower])}Z`, fill: one.band ?? "var(--band)" }));
    }
    const places = one.points.map((point) => [right(point[0]), up(point[1])]);
    drawn.append(svg("path", { d: path(places), fill: "none", stroke: one.color, "stroke-width": one.stroke ?? 2, "stroke-dasharray": one.dash, "stroke-linejoin": "round" }));
    if (one.dots) for (const [cx, cy] of places) drawn.append(svg("circle", { cx, cy, r: 2.6, fill: one.color }));
    ends.push({ name: one.name, y: places.at(-1)[1], strong: one.strong });
  }
  if (labels) {
    ends.sort((a, b) => a.y - b.y);
    for (let index = 1; index < ends.length; index++) ends[index].y = Math.max(ends[index].y, ends[index - 1].y + size + 1);
    // What was pushed below the chart pushes the others up again.
    let lowest = height - margin.bottom;
    for (const end of [...ends].reverse()) {
      end.y = Math.min(end.y, lowest);
      lowest = end.y - size - 1;
    }
    for (const end of ends) drawn.append(svg("text", { x: width - margin.right + 8, y: end.y + 4, "font-size": size, class: end.strong ? "strong" : null }, end.name));
  }
  return drawn;
}

// One row of the picture of intervals: the interval, the estimate, and where nothing is gained.
function intervalRow({ low, at, high, kept }, domain, width) {
  const right = linear(domain, [6, width - 6]);
  const color = kept ? "var(--ours)" : "var(--soft)";
  const mark = kept
    ? svg("circle", { cx: right(at), cy: 11, r: 5, fill: color })
    : svg("circle", { cx: right(at), cy: 11, r: 4.2, fill: "var(--card)", stroke: color, "stroke-width": 2 });
  return svg("svg", { width, height: 22, viewBox: `0 0 ${width} 22`, "aria-hidden": "true" },
    svg("line", { x1: right(0), x2: right(0), y1: 0, y2: 22, stroke: "var(--line)", "stroke-width": 1.5 }),
    svg("line", { x1: right(low), x2: right(high), y1: 11, y2: 11, stroke: color, "stroke-width": kept ? 3 : 2 }),
    mark);
}

// One row of the picture of trainings: a dot per training, the interval of their mean, and the mean.
function dotRow({ scores, low, mean, high, color }, domain, width) {
  const right = linear(domain, [6, width - 6]);
  const drawn = svg("svg", { width, height: 26, viewBox: `0 0 ${width} 26`, role: "img", "aria-label": `${scores.length} trainings` },
    svg("line", { x1: 6, x2: width - 6, y1: 25, y2: 25, stroke: "var(--faint)" }));
  if (low != null) drawn.append(svg("line", { x1: right(low), x2: right(high), y1: 20, y2: 20, stroke: color, "stroke-width": 2.5 }));
  drawn.append(svg("line", { x1: right(mean), x2: right(mean), y1: 15, y2: 25, stroke: color, "stroke-width": 2.5 }));
  for (const score of scores) drawn.append(svg("circle", { cx: right(score), cy: 8, r: 4.2, fill: color, "fill-opacity": 0.55, stroke: color }));
  return drawn;
}

function axisRow(domain, width) {
  const right = linear(domain, [6, width - 6]);
  const { at, decimals } = ticks(domain, width / 70);
  return svg("svg", { width, height: 16, viewBox: `0 0 ${width} 16`, "aria-hidden": "true" },
    at.map((tick) => svg("text", { x: Math.min(Math.max(right(tick), 20), width - 20), y: 12, "text-anchor": "middle", "font-size": 11.5 }, fixed(tick, decimals))));
}

function intervalAxis(domain, width) {
  const right = linear(domain, [6, width - 6]);
  const { at, decimals } = ticks(domain, width / 65);
  return svg("svg", { width, height: 16, viewBox: `0 0 ${width} 16`, "aria-hidden": "true" },
    at.map((tick) => svg("text", { x: Math.min(Math.max(right(tick), 20), width - 20), y: 12, "text-anchor": "middle", "font-size": 11.5 }, Math.abs(tick) < 1e-9 ? "0" : signed(tick, decimals))));
}

function bar(share, width) {
  return svg("svg", { width, height: 10, viewBox: `0 0 ${width} 10`, "aria-hidden": "true", style: "display:inline-block;margin-left:8px" },
    svg("rect", { x: 0, y: 0, width, height: 10, rx: 2, fill: "var(--faint)" }),
    svg("rect", { x: 0, y: 0, width: Math.max(0, Math.min(1, share)) * width, height: 10, rx: 2, fill: "var(--ours)" }));
}
