// The player: time, view and options that all panes share, buttons and keys.

const byId = (id) => document.getElementById(id);
const SPEEDS = [...byId("speed").options].map((option) => Number(option.value));

class Player {
  constructor(games) {
    this.games = games;
    this.time = 0;
    this.playing = false;
    this.view = { zoom: 1, centre: null };
    this.options = { trail: 20, separation: true, tag: true, commands: true, names: true, followed: null };
    this.panes = [];
    byId("show-tag").parentElement.style.display = games.some(hasFlags) ? "" : "none";
    this.readColours();
    this.setPanes(games.length > 1 ? 2 : 1);
  }

  get duration() { return Math.max(...this.panes.map((pane) => pane.game.duration)); }

  setPanes(count) {
    const shown = this.panes.map((pane) => this.games.indexOf(pane.game));
    this.panes = [];
    for (let k = 0; k < count; k++) this.panes.push(new Pane(this.games, shown[k] ?? Math.min(k, this.games.length - 1), this));
    byId("panes").replaceChildren(...this.panes.map((pane) => pane.root));
    byId("panes").classList.toggle("two", count > 1);
    byId("compare").textContent = count > 1 ? "One game" : "Side by side";
    byId("compare").hidden = this.games.length < 2;
    this.changed();
  }

  readColours() {
    const style = getComputedStyle(document.documentElement), read = (name) => style.getPropertyValue(name).trim();
    this.colours = {};
    for (const name of ["page", "card", "ink", "muted", "blue", "red", "grid", "edge", "nominal", "changed", "violation", "obstacle", "button"]) {
      this.colours[name] = read(`--${name}`);
    }
    this.colours.blueWater = read("--blue-water");
    this.colours.redWater = read("--red-water");
  }

  setTheme(name) {
    document.documentElement.dataset.theme = name;
    this.readColours();
    this.changed();
  }

  toggleTheme() { this.setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"); }

  changed() { this.stale = true; }

  seek(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
    this.changed();
  }

  step(count) {
    this.pause();
    const dt = this.panes[0].game.dt;
    this.seek((Math.round(this.time / dt) + count) * dt);
  }

  pause() { this.setPlaying(false); }

  setPlaying(playing) {
    if (playing && this.time >= this.duration - 1e-9) this.time = 0;
    this.playing = playing;
    byId("play").textContent = playing ? "Pause" : "Play";
    this.changed();
  }

  /** Go to the next or previous mark ("violations" or "changes") of any game shown. */
  jump(kind, direction) {
    const half = this.panes[0].game.dt / 2;
    const times = this.panes.flatMap((pane) => pane.game.marks[kind]);
    const ahead = times.filter((time) => direction * (time - this.time) > half);
    if (!ahead.length) return;
    this.pause();
    this.seek(direction > 0 ? Math.min(...ahead) : Math.max(...ahead));
  }

  faster(direction) {
    const place = SPEEDS.indexOf(Number(byId("speed").value)) + direction;
    if (place >= 0 && place < SPEEDS.length) byId("speed").value = String(SPEEDS[place]);
  }

  zoom(camera, x, y, factor) {
    const fixed = camera.toMetres(x, y), zoom = Math.min(Math.max(this.view.zoom * factor, 1), 40);
    const scale = camera.whole * zoom;
    this.view = { zoom, centre: [fixed[0] - (x - camera.width / 2) / scale, fixed[1] + (y - camera.height / 2) / scale] };
    if (zoom === 1) this.view.centre = null;
    this.changed();
  }

  pan(camera, dx, dy) {
    if (this.options.followed !== null || this.view.zoom === 1) return;
    const [x, y] = camera.centre;
    this.view.centre = [x - dx / camera.scale, y + dy / camera.scale];
    this.changed();
  }

  wholeField() {
    this.view = { zoom: 1, centre: null };
    this.options.followed = null;
    this.changed();
  }

  follow(boat) {
    const leave = this.options.followed === boat;
    this.options.followed = leave ? null : boat;
    this.view = { zoom: leave ? 1 : Math.max(this.view.zoom, 3), centre: null };
    this.changed();
  }

  frame(now) {
    const passed = Math.min((now - (this.last ?? now)) / 1000, 0.25);
    this.last = now;
    if (this.playing) {
      this.seek(this.time + passed * Number(byId("speed").value));
      if (this.time >= this.duration) this.pause();
    }
    if (this.stale || this.flashing) this.draw(now);
    requestAnimationFrame((next) => this.frame(next));
  }

  draw(now) {
    this.stale = false;
    const shown = this.panes.map((pane) => pane.draw(this.time, 0.5 - 0.5 * Math.cos(now / 110)));
    this.flashing = shown.some(({ violations }) => violations.some(({ own }) => own));
    const minutes = Math.floor((this.time + 0.05) / 60), seconds = Math.max(0, this.time - 60 * minutes);
    byId("clock").textContent = `${String(minutes).padStart(2, "0")}:${seconds.toFixed(1).padStart(4, "0")}`;
    const has = (kind) => this.panes.some((pane) => pane.game.marks[kind].length > 0);
    for (const way of ["previous", "next"]) {
      byId(`${way}-violation`).disabled = !has("violations");
      byId(`${way}-change`).disabled = !has("changes");
    }
  }
}

function connectControls(player) {
  const click = (id, action) => byId(id).addEventListener("click", action);
  click("play", () => player.setPlaying(!player.playing));
  click("back", () => player.step(-1));
  click("forward", () => player.step(1));
  click("next-violation", () => player.jump("violations", 1));
  click("previous-violation", () => player.jump("violations", -1));
  click("next-change", () => player.jump("changes", 1));
  click("previous-change", () => player.jump("changes", -1));
  click("theme", () => player.toggleTheme());
  click("help", () => byId("keys").showModal());
  click("compare", () => player.setPanes(player.panes.length > 1 ? 1 : 2));
  for (const name of ["separation", "tag", "commands", "names"]) {
    byId(`show-${name}`).addEventListener("change", (event) => {
      player.options[name] = event.target.checked;
      player.changed();
    });
  }
  byId("trail").addEventListener("input", (event) => {
    player.options.trail = Number(event.target.value);
    byId("trail-text").textContent = `${event.target.value} s`;
    player.changed();
  });
  window.addEventListener("resize", () => player.changed());
}

function connectKeys(player) {
  const actions = {
    " ": () => player.setPlaying(!player.playing),
    ArrowLeft: (shift) => player.step(shift ? -Math.round(1 / player.panes[0].game.dt) : -1),
    ArrowRight: (shift) => player.step(shift ? Math.round(1 / player.panes[0].game.dt) : 1),
    ArrowUp: () => player.faster(1),
    ArrowDown: () => player.faster(-1),
    b: (shift) => player.jump("violations", shift ? -1 : 1),
    i: (shift) => player.jump("changes", shift ? -1 : 1),
    Home: () => player.seek(0),
    End: () => player.seek(player.duration),
    0: () => player.wholeField(),
    t: () => player.toggleTheme(),
    "?": () => byId("keys").showModal(),
  };
  document.addEventListener("keydown", (event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const typing = event.target.tagName === "SELECT" || event.target.type === "range";
    if (event.ctrlKey || event.metaKey || event.altKey || byId("keys").open || typing || !(key in actions)) return;
    event.preventDefault();
    actions[key](event.shiftKey);
  });
}

/** Where a link such as replay.html#t=12.5 points to. */
function linkedTime() {
  const found = /[#&]t=([0-9.]+)/.exec(location.hash);
  return found ? Number(found[1]) : 0;
}

async function start() {
  const packed = JSON.parse(byId("data").textContent);
  const games = await Promise.all(packed.games.map((game) => Game.open(game)));
  const dark = window.matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  const player = new Player(games);
  connectControls(player);
  connectKeys(player);
  player.seek(linkedTime());
  requestAnimationFrame((now) => player.frame(now));
}

start().catch((error) => {
  byId("trouble").hidden = false;
  byId("trouble").textContent = error.message;
});
