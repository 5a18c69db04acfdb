"use strict";
// Episodes of an environment in Python, in pictures: demonstration, agent before, and agent after by each judge, side by side.

(function () {
  const { films, missing } = replay;
  if (!films.length) return;
  const section = document.getElementById("replay");
  section.append(
    el("h2", {}, "Replay"),
    el("p", { class: "soft" }, episodesBeside(false).length ? "Demonstrations, their recorded actions played again, and the agent before and after imitating each, as the environment renders them. Of the episodes that the agent was scored by, this is the one whose scores are the most typical; its start is the same for all." : "Demonstrations, their recorded actions played again, as the environment renders them."));
  if (missing) section.append(el("p", { class: "small" }, missing));

  const played = report.entries.filter((entry) => isPlayed(entry.demo));
  if (played.length < report.entries.length) section.append(el("p", { class: "small" }, `Of the ${count(report.entries.length)} demonstrations ${played.length} are shown: the best and the worst.`));
  const asked = new URLSearchParams(location.hash.slice(1));
  const wanted = Number(asked.get("demo") ?? NaN);
  const state = {
    demo: played.some((entry) => entry.demo === wanted) ? wanted : played[0].demo,
    secs: Number(asked.get("at") ?? 0) || 0,
    playing: !asked.has("at") && !matchMedia("(prefers-reduced-motion: reduce)").matches, speed: 1,
  };

  const choose = el("select", { "aria-label": "demonstration", on: { change: () => show(Number(choose.value)) } },
    played.map((entry) => el("option", { value: entry.demo }, `${entry.demo} – rank ${placeOf.get(entry.demo)}${entry.kept ? ", kept" : ""}`)));
  const play = el("button", { class: "play", on: { click: () => { state.playing = !state.playing; told(); } } });
  const scrub = el("input", { type: "range", min: 0, max: 1, step: 0.001, value: 0, "aria-label": "moment", on: { input: () => {
    state.playing = false; state.secs = Number(scrub.value) * lasts(); told();
  } } });
  const clock = el("span", { class: "small soft", style: "min-width:8em" });
  const speed = el("select", { "aria-label": "speed", on: { change: () => { state.speed = Number(speed.value); } } },
    [[1, "1×"], [0.5, "½×"], [0.25, "¼×"]].map(([value, name]) => el("option", { value }, name)));
  const panels = episodesBeside(films.some((film) => film.part === "demonstration"))
    .map((panel) => ({ ...panel, label: el("p", { class: "small" }), canvas: el("canvas", { class: "film", "aria-label": panel.name }), film: null }));
  section.append(
    el("div", { class: "controls" }, el("label", {}, "Demonstration", choose), play, scrub, clock, speed),
    el("div", { class: `stage of${panels.length}` }, panels.map((panel) => el("div", {}, panel.label, panel.canvas))));

  function picture(film) {
    if (!film.image) {
      film.image = new Image();
      film.image.addEventListener("load", told);
      film.image.src = `data:image/png;base64,${film.strip}`;
    }
    return film.image;
  }

  function cast() {
    for (const panel of panels) {
      panel.film = films.find((film) => film.part === panel.part && film.judge === panel.judge && (panel.part === "before" || film.demo === state.demo)) ?? null;
      const film = panel.film;
      panel.canvas.hidden = !film;
      if (!film) { panel.label.replaceChildren(el("b", {}, panel.name), el("br"), "not shown"); continue; }
      [panel.canvas.width, panel.canvas.height] = [film.width, film.height];
      panel.label.replaceChildren(el("b", {}, panel.name), el("br"), episodeInWords(film));
    }
    choose.value = state.demo;
    told();
  }

  function lasts() {
    return Math.max(report.control_step_secs, ...panels.map(({ film }) => (film ? (film.steps - 1) * report.control_step_secs : 0)));
  }

  function told() {
    play.textContent = state.playing ? "❚❚ Pause" : "▶ Play";
    scrub.value = state.secs / lasts();
    clock.textContent = `${Math.min(state.secs, lasts()).toFixed(2)} of ${lasts().toFixed(2)} s`;
    const step = Math.round(state.secs / report.control_step_secs);
    for (const { film, canvas } of panels) {
      if (!film || !picture(film).complete) continue;
      // The last picture that is not ahead of the moment.
      const frame = Math.max(0, film.at.findLastIndex((at) => at <= step));
      canvas.getContext("2d").drawImage(film.image, frame * film.width, 0, film.width, film.height, 0, 0, film.width, film.height);
    }
  }

  function show(demo) {
    state.demo = demo;
    state.secs = 0;
    cast();
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
  cast();
  requestAnimationFrame(tick);
})();
