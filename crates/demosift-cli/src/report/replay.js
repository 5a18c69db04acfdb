"use strict";
// Demonstration, agent before, and agent after by each judge, side by side: one scene that takes the pose of each in turn.

(function () {
  const { scene: model, episodes, films, missing } = replay;
  if (films.length) return;
  const section = document.getElementById("replay");
  section.append(el("h2", {}, "Replay"));
  if (!model || !episodes.length) {
    section.append(el("p", { class: "soft" }, missing ?? "There is nothing to play."));
    return;
  }
  section.append(el("p", { class: "soft" }, (episodesBeside(false).length ? "A demonstration as it was recorded, and the agent before and after imitating it by each judge. Of its evaluation episodes this is the one whose scores are the most typical; its start is the same for all." : "A demonstration as it was recorded.") + " Drag to turn, and use the wheel with Ctrl to come nearer." + whichLooked));
  if (missing) section.append(el("p", { class: "small" }, missing));
  if (model.left_out) section.append(el("p", { class: "small" }, `${model.left_out} shape${model.left_out > 1 ? "s" : ""} of the model (meshes or fields of heights) cannot be drawn here.`));

  const { state, chooser, controls: steering, told, start } = player({
    section, entries: report.entries.filter((entry) => isLooked(entry.demo)), cast,
    lasts: () => secondsOf(panels.map(({ episode }) => episode)), moved: () => { seen.dirty = true; },
  });
  const seen = { variant: 0, dirty: true };
  const chooseVariant = el("select", { on: { change: () => { seen.variant = Number(chooseVariant.value); cast(); told(); } } },
    report.variants.map((name, variant) => el("option", { value: variant }, name)));
  const canvas = el("canvas", { "aria-label": "3-D replay of demonstration, agent before and agent after" });
  const panels = episodesBeside(true)
    .map((panel) => ({ ...panel, label: el("div", {}), box: el("div", { class: "panel" }), episode: null }));
  for (const panel of panels) panel.box.append(panel.label);
  const stage = el("div", { class: `stage of${panels.length}` }, canvas, panels.map((panel) => panel.box));
  section.append(
    el("div", { class: "controls" },
      chooser, several ? el("label", {}, "Variant", chooseVariant) : null,
      steering, el("button", { on: { click: () => look() } }, "Reset view")),
    stage);

  const shown = {
    demonstration: (one) => one.part === "demonstration" && one.demo === state.demo,
    before: (one, judge) => one.part === "before" && one.judge === judge && one.variant === seen.variant,
    after: (one, judge) => one.part === "after" && one.judge === judge && one.demo === state.demo && one.variant === seen.variant,
  };

  function cast() {
    for (const panel of panels) panel.episode = episodes.find((one) => shown[panel.part](one, panel.judge)) ?? null;
    for (const panel of panels) {
      const episode = panel.episode;
      panel.label.className = episode ? "" : "none";
      if (!episode) { panel.label.replaceChildren(`${panel.name}: ${panel.part === "demonstration" ? "no states recorded" : "not played"}`); continue; }
      panel.label.replaceChildren(el("b", {}, panel.name), el("br"), el("span", { class: "small" }, episodeInWords(episode)));
    }
    seen.dirty = true;
  }

  // Poses.
  function decoded(episode) {
    if (!episode.numbers) {
      const text = atob(episode.poses);
      const bytes = new Uint8Array(text.length);
      for (let index = 0; index < text.length; index++) bytes[index] = text.charCodeAt(index);
      const view = new DataView(bytes.buffer);
      episode.numbers = Float32Array.from({ length: bytes.length / 2 }, (_, index) => view.getInt16(index * 2, true) / 32767);
    }
    return episode.numbers;
  }

  function position(episode, frame, body, into) {
    const at = (frame * model.bodies + body) * 7;
    const numbers = decoded(episode);
    const axis = (index) => episode.low[index] + ((numbers[at + index] + 1) / 2) * (episode.high[index] - episode.low[index]);
    return into.set(axis(0), axis(1), axis(2));
  }

  function turned(episode, frame, body, into) {
    const at = (frame * model.bodies + body) * 7 + 3;
    const numbers = decoded(episode);
    return into.set(numbers[at + 1], numbers[at + 2], numbers[at + 3], numbers[at]).normalize();
  }

  // The model.
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
  } catch {
    stage.replaceChildren(el("p", { class: "soft" }, "This browser cannot draw the replay: it has no WebGL."));
    return;
  }
  const scene = new THREE.Scene();
  // The ground fades into the sky, or its lines would flicker toward the horizon.
  scene.fog = new THREE.Fog(0xffffff, 10, 40);
  const world = new THREE.Group();
  scene.add(world);
  scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8f96, 2.1));
  const sun = new THREE.DirectionalLight(0xffffff, 1.7);
  sun.position.set(3, -5, 9);
  scene.add(sun);
  const bodies = Array.from({ length: model.bodies }, () => new THREE.Group());
  if (bodies.length) world.add(...bodies);
  const grounds = [];

  function geometry({ kind, size: [x, y, z] }) {
    switch (kind) {
      case "plane": return new THREE.PlaneGeometry(2 * x, 2 * y);
      case "sphere": return new THREE.SphereGeometry(x, 24, 16);
      // MuJoCo's long axis is z, and that of three.js is y.
      case "capsule": return new THREE.CapsuleGeometry(x, 2 * y, 8, 20).rotateX(Math.PI / 2);
      case "cylinder": return new THREE.CylinderGeometry(x, x, 2 * y, 28).rotateX(Math.PI / 2);
      case "ellipsoid": return new THREE.SphereGeometry(1, 24, 16).scale(x, y, z);
      default: return new THREE.BoxGeometry(2 * x, 2 * y, 2 * z);
    }
  }

  for (const shape of model.shapes) {
    const [red, green, blue, opacity] = shape.rgba;
    const color = new THREE.Color().setRGB(red, green, blue, "srgb");
    const material = new THREE.MeshLambertMaterial({ color, transparent: opacity < 1, opacity });
    const mesh = new THREE.Mesh(geometry(shape), material);
    mesh.position.fromArray(shape.position);
    mesh.quaternion.set(shape.quaternion[1], shape.quaternion[2], shape.quaternion[3], shape.quaternion[0]);
    (shape.body == null ? world : bodies[shape.body]).add(mesh);
    if (shape.kind === "plane" && shape.body == null) {
      grounds.push(material);
      const grid = new THREE.GridHelper(80, 80, 0x808890, 0x808890);
      grid.rotateX(Math.PI / 2);
      grid.position.z = shape.position[2] + 0.002;
      grid.material.transparent = true;
      grid.material.opacity = 0.35;
      world.add(grid);
    }
  }

  // From where to look.
  const camera = new THREE.PerspectiveCamera(45, 1, 0.02, 200);
  camera.up.set(0, 0, 1);
  const controls = new THREE.OrbitControls(camera, canvas);
  controls.addEventListener("change", () => { seen.dirty = true; });
  // The wheel scrolls the page; with Ctrl it zooms.
  canvas.addEventListener("wheel", (event) => { if (!event.ctrlKey) event.stopImmediatePropagation(); }, { capture: true });

  function look() {
    const center = new THREE.Vector3();
    const one = new THREE.Vector3();
    const first = panels.find((panel) => panel.episode)?.episode ?? episodes[0];
    for (let body = 0; body < model.bodies; body++) center.add(position(first, 0, body, one));
    center.divideScalar(Math.max(1, model.bodies));
    if (model.camera) {
      const direction = new THREE.Vector3(...model.camera.direction);
      camera.position.fromArray(model.camera.position);
      camera.fov = Math.min(80, model.camera.field_of_view * 1.15);
      const away = Math.max(0.5, one.copy(center).sub(camera.position).dot(direction));
      controls.target.copy(camera.position).addScaledVector(direction, away);
    } else {
      controls.target.copy(center);
      camera.position.copy(center).add(new THREE.Vector3(2.2, -3.2, 1.4));
    }
    controls.update();
    const away = camera.position.distanceTo(controls.target);
    [scene.fog.near, scene.fog.far] = [1.6 * away, 5 * away];
    seen.dirty = true;
  }

  const one = { from: new THREE.Vector3(), to: new THREE.Vector3(), a: new THREE.Quaternion(), b: new THREE.Quaternion() };
  function pose(episode) {
    const step = Math.min(state.secs / report.control_step_secs, episode.steps - 1);
    const frame = Math.min(Math.floor(step / episode.stride), episode.frames - 1);
    const next = Math.min(frame + 1, episode.frames - 1);
    // The last frame is that of the last step, which may be less than a stride after the one before.
    const between = Math.min(episode.stride, episode.steps - 1 - frame * episode.stride);
    const share = between > 0 ? Math.min(1, (step - frame * episode.stride) / between) : 0;
    bodies.forEach((body, index) => {
      body.position.lerpVectors(position(episode, frame, index, one.from), position(episode, next, index, one.to), share);
      body.quaternion.slerpQuaternions(turned(episode, frame, index, one.a), turned(episode, next, index, one.b), share);
    });
    world.position.set(0, 0, 0);
    const follows = model.camera?.follows;
    if (follows != null) {
      position(episode, 0, follows, one.from);
      world.position.set(one.from.x - bodies[follows].position.x, one.from.y - bodies[follows].position.y, 0);
    }
  }

  const colors = { sky: new THREE.Color(), ground: new THREE.Color() };
  function paint() {
    const style = getComputedStyle(document.documentElement);
    colors.sky.setStyle(style.getPropertyValue("--sky").trim());
    colors.ground.setStyle(style.getPropertyValue("--ground").trim());
    scene.fog.color.copy(colors.sky);
    for (const material of grounds) material.color.copy(colors.ground);
    seen.dirty = true;
  }
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);

  function draw() {
    const whole = stage.getBoundingClientRect();
    if (!whole.width || !whole.height) return;
    renderer.setPixelRatio(Math.min(2, devicePixelRatio || 1));
    renderer.setSize(whole.width, whole.height, false);
    renderer.setScissorTest(true);
    renderer.setClearColor(colors.sky);
    for (const panel of panels) {
      const box = panel.box.getBoundingClientRect();
      const place = [box.left - whole.left, whole.bottom - box.bottom, box.width, box.height];
      renderer.setViewport(...place);
      renderer.setScissor(...place);
      renderer.clear();
      if (!panel.episode) continue;
      camera.aspect = box.width / box.height;
      camera.updateProjectionMatrix();
      pose(panel.episode);
      renderer.render(scene, camera);
    }
  }

  function tick() {
    requestAnimationFrame(tick);
    if (!seen.dirty) return;
    seen.dirty = false;
    draw();
  }
  new ResizeObserver(() => { seen.dirty = true; }).observe(stage);

  start();
  look();
  paint();
  requestAnimationFrame(tick);
})();
