"use strict";
// What a replay is steered by: which demonstration, which moment, how fast. What is seen at that moment is drawn by who asks for it:
// of the `entries` that can be chosen, `cast` puts another demonstration on the stage, `lasts` says how many seconds it takes, and
// `moved` shows the moment.

function player({ section, entries, cast, lasts, moved }) {
  // What the address asks for, such as #demo=4&at=0.8.
  const asked = new URLSearchParams(location.hash.slice(1));
  const wanted = Number(asked.get("demo") ?? NaN);
  const state = {
    demo: entries.some((entry) => entry.demo === wanted) ? wanted : entries[0].demo,
    secs: Number(asked.get("at") ?? 0) || 0,
    playing: !asked.has("at") && !matchMedia("(prefers-reduced-motion: reduce)").matches, speed: 1,
  };

  const choose = el("select", { "aria-label": "demonstration", on: { change: () => show(Number(choose.value)) } },
    entries.map((entry) => el("option", { value: entry.demo }, `${entry.demo} – rank ${placeOf.get(entry.demo)}${entry.kept ? ", kept" : ""}`)));
  const play = el("button", { class: "play", on: { click: () => { state.playing = !state.playing; told(); } } });
  const scrub = el("input", { type: "range", min: 0, max: 1, step: 0.001, value: 0, "aria-label": "moment", on: { input: () => {
    state.playing = false; state.secs = Number(scrub.value) * lasts(); told();
  } } });
  const clock = el("span", { class: "small soft", style: "min-width:8em" });
  const speed = el("select", { "aria-label": "speed", on: { change: () => { state.speed = Number(speed.value); } } },
    [[1, "1×"], [0.5, "½×"], [0.25, "¼×"]].map(([value, name]) => el("option", { value }, name)));

  function told() {
    play.textContent = state.playing ? "❚❚ Pause" : "▶ Play";
    scrub.value = state.secs / lasts();
    clock.textContent = `${Math.min(state.secs, lasts()).toFixed(2)} of ${lasts().toFixed(2)} s`;
    moved();
  }

  function show(demo) {
    state.demo = demo;
    state.secs = 0;
    choose.value = demo;
    cast();
    told();
  }
  window.showDemonstration = (demo) => {
    show(demo);
    section.scrollIntoView({ behavior: "smooth", block: "start" });
  };

  let last = null;
  function tick(now) {
    requestAnimationFrame(tick);
    if (state.playing && last != null) {
      state.secs += ((now - last) / 1000) * state.speed;
      // A moment of rest at the end, then again.
      if (state.secs > lasts() + 0.6) state.secs = 0;
      told();
    }
    last = now;
  }

  function start() {
    choose.value = state.demo;
    cast();
    told();
    requestAnimationFrame(tick);
  }
  return { state, chooser: el("label", {}, "Demonstration", choose), controls: [play, scrub, clock, speed], told, start };
}

/** Seconds that the longest of some episodes takes. */
function secondsOf(episodes) {
  return Math.max(report.control_step_secs, ...episodes.map((episode) => (episode ? (episode.steps - 1) * report.control_step_secs : 0)));
}
