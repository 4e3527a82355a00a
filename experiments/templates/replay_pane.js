// One game on the page: its picture, its timeline and the table of its boats.

const COLUMNS = ["boat", "speed", "nominal", "filtered", "shield", "margin", "state"];

function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

/** How many things there are: 1 hit, 2 hits. */
const countText = (count, one) => `${count} ${one}${count === 1 ? "" : "s"}`;

/** Long names without their folders and their middle, so that what stands behind them is seen on a phone, too. */
function shortened(words) {
  const name = (word) => word.length > 18 ? `${word.slice(0, 8)}…${word.slice(-9)}` : word;
  return words.replace(/[^\s,:]+/g, (word) => name(word.split("/").pop() || word));
}

/** Whether a game is for flags; an encounter has none, nor halves of a field. */
const hasFlags = (game) => game.meta.catch_radius_m > 0;

function numberText(value, digits) {
  return Number.isFinite(value) ? value.toFixed(digits).replace("-", "−") : "–";
}

/** A command as text: speed and compass heading. */
function commandText(speed, heading) {
  if (!Number.isFinite(speed) || !Number.isFinite(heading)) return "unusable";
  return `${speed.toFixed(1)} @ ${String(((Math.round(heading) % 360) + 360) % 360).padStart(3, "0")}°`;
}

/** Fit a canvas to its place on the page; returns its size in CSS pixels. */
function fitCanvas(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  const wide = Math.round(width * ratio), high = Math.round(height * ratio);
  if (canvas.width !== wide || canvas.height !== high) { canvas.width = wide; canvas.height = high; }
  canvas.getContext("2d").setTransform(ratio, 0, 0, ratio, 0, 0);
}

class Pane {
  /** player: the shared state (time, view, options, colours) and what a pane may ask of it. */
  constructor(games, index, player) {
    this.games = games;
    this.player = player;
    this.chooser = element("select", { ariaLabel: "game" });
    games.forEach(({ title }, k) =>
      this.chooser.append(element("option", { value: k, textContent: shortened(title), title })));
    this.score = element("span", { className: "score" });
    this.badges = element("span");
    this.field = element("canvas", { className: "field" });
    this.timeline = element("canvas", { className: "timeline", tabIndex: 0 });
    this.timeline.setAttribute("role", "slider");
    this.timeline.setAttribute("aria-label", "time");
    this.rows = element("tbody");
    const head = element("tr", {}, ...COLUMNS.map((name) => element("th", { textContent: name })));
    const table = element("table", {}, element("thead", {}, head), this.rows);
    this.note = element("p", { className: "note" });
    this.root = element("section", { className: "pane" },
      element("div", { className: "pane-head" }, this.chooser, this.score, this.badges),
      element("div", { className: "pane-body" },
        element("div", {}, this.field, this.timeline),
        element("div", { className: "boats" }, table, this.note)));
    this.chooser.addEventListener("change", () => this.show(Number(this.chooser.value)));
    this.listen();
    this.show(index);
  }

  show(index) {
    this.game = this.games[index];
    this.chooser.value = String(index);
    this.chooser.title = this.game.title;
    this.timelineKey = "";
    const { meta } = this.game;
    const badge = (kind, ...parts) => element("span", { className: `badge ${kind}` }, ...parts);
    const covered = meta.shielded.length > 0, violated = this.game.ownViolations.length > 0;
    this.badges.replaceChildren(
      badge(covered ? "on" : "", this.sideText(this.game.ownTeam), covered ? ` shielded, ${countText(meta.shielded.length, "boat")}` : " without a shield"), " ",
      badge(violated ? "violation" : "", ...this.violationText()));
    const word = (text, kind) => element("span", { className: kind, textContent: text });
    this.note.replaceChildren("timeline: ", word("share of boats whose command was changed", "orange"), ", ",
      word("hits", "pink"), hasFlags(this.game) ? ", captures" : "", " · table: speeds m/s, compass headings, margin = safety margin, room beyond the required distance, m · ",
      `hit: a boat of `, this.sideText(this.game.ownTeam), ` within ${meta.separation_m} m of another, discs touch; `,
      `dashed rings: the other team among itself · `,
      [meta.preset, ...new Set(meta.platforms), ...(meta.seed === null ? [] : [`seed ${meta.seed}`])].join(", "));
    this.score.hidden = !hasFlags(this.game);
    this.rows.replaceChildren(...meta.agent_ids.map((name, boat) => this.makeRow(name, boat)));
    this.player.changed();
  }

  sideText(team) {
    const side = team === 0 ? "blue" : "red";
    return element("b", { className: side, textContent: side });
  }

  /** How often boats came too close, the other team among itself apart: no shield answers for that. */
  violationText() {
    const { ownTeam, ownViolations, violations } = this.game, other = violations.length - ownViolations.length;
    const parts = [this.sideText(ownTeam), `: ${countText(ownViolations.length, "hit")}`];
    return other ? [...parts, ` (and ${other} among `, this.sideText(1 - ownTeam), ")"] : parts;
  }

  makeRow(name, boat) {
    const chip = element("span", { className: "chip" });
    chip.style.background = `var(--${this.game.meta.team[boat] === 0 ? "blue" : "red"})`;
    const cells = COLUMNS.map((column) => element("td", { className: column === "speed" || column === "margin" ? "number" : "" }));
    cells[0].append(chip, name);
    const row = element("tr", { title: "click to follow this boat" }, ...cells);
    row.addEventListener("click", () => this.player.follow(boat));
    return row;
  }

  listen() {
    const seek = (event) => {
      const box = this.timeline.getBoundingClientRect();
      this.player.seek((event.clientX - box.left) / box.width * this.game.duration);
    };
    this.timeline.addEventListener("pointerdown", (event) => { this.timeline.setPointerCapture(event.pointerId); seek(event); });
    this.timeline.addEventListener("pointermove", (event) => { if (event.buttons) seek(event); });
    this.field.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.player.zoom(this.camera, event.offsetX, event.offsetY, Math.exp(-event.deltaY * 0.0015));
    }, { passive: false });
    this.field.addEventListener("pointerdown", (event) => this.field.setPointerCapture(event.pointerId));
    this.field.addEventListener("pointermove", (event) => {
      if (event.buttons) this.player.pan(this.camera, event.movementX, event.movementY);
    });
    this.field.addEventListener("dblclick", () => this.player.wholeField());
  }

  draw(time, pulse) {
    const { view, options, colours } = this.player;
    const [fieldWidth, fieldHeight] = this.game.meta.env_bounds_m;
    const width = this.field.clientWidth || 600;
    const height = Math.min((width - 16) * fieldHeight / fieldWidth + 16, Math.max(260, window.innerHeight - 230));
    this.field.style.height = `${height}px`;
    fitCanvas(this.field, width, height);
    this.camera = new Camera(this.game, width, height, this.followedView(view, options, time));
    const shown = drawMoment(this.field.getContext("2d"), this.game, this.camera, time, colours, options, pulse);
    this.drawTimeline(time, colours);
    this.fill(shown);
    return shown;
  }

  followedView(view, options, time) {
    if (options.followed === null || options.followed >= this.game.boats) return view;
    const { step, share } = this.game.at(time), pose = this.game.pose(options.followed, step, share);
    return { zoom: view.zoom, centre: [pose.x, pose.y] };
  }

  drawTimeline(time, colours) {
    const width = this.timeline.clientWidth || 600, height = this.timeline.clientHeight || 58;
    fitCanvas(this.timeline, width, height);
    const key = `${width} ${this.game.title} ${colours.page} ${this.timeline.width}`;
    if (key !== this.timelineKey) {
      this.timelineKey = key;
      this.marks = document.createElement("canvas");
      fitCanvas(this.marks, width, height);
      drawMarks(this.marks.getContext("2d"), this.game, width, height, colours);
    }
    const context = this.timeline.getContext("2d");
    context.clearRect(0, 0, width, height);
    context.drawImage(this.marks, 0, 0, width, height);
    const x = Math.min(time / Math.max(this.game.duration, 1e-9), 1) * width;
    context.fillStyle = colours.ink;
    context.fillRect(Math.min(Math.max(x - 1, 0), width - 2), 0, 2, height);
    this.timeline.setAttribute("aria-valuemax", this.game.duration.toFixed(1));
    this.timeline.setAttribute("aria-valuenow", Math.min(time, this.game.duration).toFixed(1));
  }

  fill({ step, violations }) {
    const game = this.game, [blue, red] = game.score(step);
    this.score.replaceChildren(element("span", { className: "blue", textContent: blue }), " : ",
      element("span", { className: "red", textContent: red }));
    const inViolation = new Map();
    for (const violation of [...violations].sort((a, b) => a.own - b.own)) violation.boats.forEach((boat) => inViolation.set(boat, violation));
    [...this.rows.children].forEach((row, boat) => {
      const texts = game.steps === 0 ? ["", "–", "–", "–", "–", "–"] : this.texts(boat, step);
      const bits = [[HAS_FLAG, "flag"], [TAGGED, "tagged"], [OUT, "out"]];
      const states = bits.filter(([mask]) => game.bit(boat, step, mask)).map(([, text]) => text);
      const near = inViolation.get(boat);
      if (near) states.push(`${near.own ? "hit" : "close"} ${near.gap.toFixed(2)} m`);
      texts[6] = states.join(", ");
      for (let k = 1; k < texts.length; k++) if (row.cells[k].textContent !== texts[k]) row.cells[k].textContent = texts[k];
      row.classList.toggle("changed", game.intervened(boat, step));
      row.classList.toggle("followed", this.player.options.followed === boat);
    });
  }

  texts(boat, step) {
    const game = this.game;
    const command = (name) => commandText(game.command(`${name}_speed`, boat, step), game.command(`${name}_heading`, boat, step));
    return ["", numberText(game.state("speed", boat, step), 2), command("nominal"), command("filtered"),
      game.reasonText(game.command("reason", boat, step)), numberText(game.command("safety_margin", boat, step), 2)];
  }
}
