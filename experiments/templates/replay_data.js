// Unpacking the games that are embedded in this file. The writer (replay_html.py) describes the format.

const NOT_COVERED = 6;  // reason code of a boat for which no shield decided

/** Inflated bytes of a base64 text. */
async function unpack(text) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  if (typeof DecompressionStream === "undefined") {
    throw new Error("This browser cannot inflate data. Use a newer one.");
  }
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Codes of one column of a record: undo the differences over time. */
function readCodes(bytes, column) {
  const { start, length, bits, against } = column;
  const view = new DataView(bytes.buffer, bytes.byteOffset + start, length * (bits / 8));
  const codes = bits === 16 ? new Uint16Array(length) : new Uint8Array(length);
  for (let k = 0; k < length; k++) codes[k] = bits === 16 ? view.getUint16(2 * k, true) : view.getUint8(k);
  if (against === "previous") {
    const rows = column.rows;
    for (let first = 0; first < length; first += rows) {
      for (let k = first + 1; k < first + rows; k++) codes[k] += codes[k - 1];
    }
  }
  return codes;
}

/** Numbers of all columns, each an array of series: series s at time index k is values[s * rows + k]. */
function readColumns(bytes, columns) {
  const codes = {}, values = {};
  for (const column of columns) {
    const own = readCodes(bytes, column);
    if (column.against && column.against !== "previous") {
      const other = codes[column.against];
      for (let k = 0; k < own.length; k++) own[k] += other[k];
    }
    codes[column.name] = own;
    if (column.scale === undefined) { values[column.name] = own; continue; }
    const numbers = new Float32Array(own.length);
    for (let k = 0; k < own.length; k++) {
      numbers[k] = column.nan !== undefined && own[k] === column.nan ? NaN : column.offset + column.scale * own[k];
    }
    values[column.name] = numbers;
  }
  return values;
}

/** One game with the look-ups that drawing needs. */
class Game {
  static async open(packed) {
    return new Game(packed, readColumns(await unpack(packed.data), packed.columns));
  }

  constructor(packed, values) {
    this.meta = packed.meta;
    this.title = packed.title;
    this.steps = packed.steps;
    this.boats = packed.meta.agent_ids.length;
    this.dt = packed.meta.dt_s;
    this.duration = this.steps * this.dt;
    this.violations = packed.violations;
    this.captures = packed.captures;
    this.ownTeam = packed.own_team;
    this.ownViolations = this.violations.filter(([, a, b]) => [a, b].some((boat) => this.meta.team[boat] === this.ownTeam));
    this.values = values;
    this.marks = this.findMarks();
  }

  /** Value of a state (T+1 rows) or command (T rows) series. */
  state(name, series, step) { return this.values[name][series * (this.steps + 1) + step]; }
  command(name, series, step) { return this.values[name][series * this.steps + Math.min(step, this.steps - 1)]; }
  bit(boat, step, mask) { return (this.state("bits", boat, step) & mask) !== 0; }
  intervened(boat, step) { return this.steps > 0 && this.command("intervened", boat, step) !== 0; }

  /** Index of the state shown at a time, and how far it is to the next one (0..1). */
  at(time) {
    const exact = Math.min(Math.max(time / this.dt, 0), this.steps);
    const step = Math.min(Math.floor(exact + 1e-6), this.steps);
    return { step, share: Math.max(0, exact - step) };
  }

  /** Position and heading between two steps, for smooth motion. */
  pose(boat, step, share) {
    const next = Math.min(step + 1, this.steps);
    const between = (name, series) => {
      const a = this.state(name, series, step), b = this.state(name, series, next);
      return a + (b - a) * share;
    };
    const heading = this.state("heading", boat, step);
    const turn = ((this.state("heading", boat, next) - heading + 540) % 360) - 180;
    return { x: between("position", 2 * boat), y: between("position", 2 * boat + 1), heading: heading + turn * share };
  }

  score(step) {
    let latest = [0, 0];
    for (const [when, blue, red] of this.captures) if (when <= step) latest = [blue, red];
    return latest;
  }

  reasonText(code) {
    const name = this.meta.reason_names[code];
    if (code === NOT_COVERED) return "no shield";
    return (name === undefined ? "reason " + code : name.replaceAll("_", " ").toLowerCase()).replace("qp", "QP");
  }

  /** Times of the own team's violations, and of steps at which interventions begin. */
  findMarks() {
    const violations = [...new Set(this.ownViolations.map((violation) => violation[0] * this.dt))];
    const changes = [];
    for (let step = 0; step < this.steps; step++) {
      for (let boat = 0; boat < this.boats; boat++) {
        if (this.intervened(boat, step) && !(step > 0 && this.intervened(boat, step - 1))) {
          changes.push(step * this.dt);
          break;
        }
      }
    }
    return { violations, changes };
  }
}
