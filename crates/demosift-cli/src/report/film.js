"use strict";
// Episodes of an environment in Python, in pictures: demonstration, agent before, and agent after by each judge, side by side.

(function () {
  const { films, missing } = replay;
  if (!films.length) return;
  const section = document.getElementById("replay");
  section.append(
    el("h2", {}, "Replay"),
    el("p", { class: "soft" }, episodesBeside(false).length ? "Demonstrations, their recorded actions played again, and the agent before and after imitating each, as the environment renders them. Of its evaluation episodes this is the one whose scores are the most typical; its start is the same for all." : "Demonstrations, their recorded actions played again, as the environment renders them."));
  if (missing) section.append(el("p", { class: "small" }, missing));

  const played = report.entries.filter((entry) => isPlayed(entry.demo));
  if (played.length < report.entries.length) section.append(el("p", { class: "small" }, `Of the ${count(report.entries.length)} demonstrations ${played.length} are shown: the best and the worst.`));
  const { state, chooser, controls, told, start } = player({ section, entries: played, cast, lasts: () => secondsOf(panels.map(({ film }) => film)), moved: draw });
  const panels = episodesBeside(films.some((film) => film.part === "demonstration"))
    .map((panel) => ({ ...panel, label: el("p", { class: "small" }), canvas: el("canvas", { class: "film", "aria-label": panel.name }), film: null }));
  section.append(
    el("div", { class: "controls" }, chooser, controls),
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
  }

  function draw() {
    const step = Math.round(state.secs / report.control_step_secs);
    for (const { film, canvas } of panels) {
      if (!film || !picture(film).complete) continue;
      // The last picture that is not ahead of the moment.
      const frame = Math.max(0, film.at.findLastIndex((at) => at <= step));
      canvas.getContext("2d").drawImage(film.image, frame * film.width, 0, film.width, film.height, 0, 0, film.width, film.height);
    }
  }

  start();
})();
