// Drawing one moment of a game on a canvas.

const LOOKAHEAD_S = 4;       // commands are drawn as the way gone in this time
const HAS_FLAG = 1, TAGGED = 2, OUT = 4;
const HALF_HULL = [[0, 0.5], [0.08, 0.41], [0.17, 0.25], [0.235, 0.04], [0.245, -0.22], [0.21, -0.47], [0.15, -0.5]];
const HULL = [...HALF_HULL, ...HALF_HULL.slice(1).reverse().map(([x, y]) => [-x, y])];

/** The part of the field shown: metres to pixels. */
class Camera {
  constructor(game, width, height, view) {
    const [fieldWidth, fieldHeight] = game.meta.env_bounds_m;
    this.whole = Math.min((width - 16) / fieldWidth, (height - 16) / fieldHeight);
    this.scale = this.whole * view.zoom;
    this.width = width;
    this.height = height;
    this.centre = view.centre || [fieldWidth / 2, fieldHeight / 2];
  }
  x(metres) { return this.width / 2 + (metres - this.centre[0]) * this.scale; }
  y(metres) { return this.height / 2 - (metres - this.centre[1]) * this.scale; }
  toMetres(x, y) {
    return [this.centre[0] + (x - this.width / 2) / this.scale, this.centre[1] - (y - this.height / 2) / this.scale];
  }
}

function circle(context, camera, x, y, radius) {
  context.beginPath();
  context.arc(camera.x(x), camera.y(y), radius * camera.scale, 0, 2 * Math.PI);
}

function polygon(context, points) {
  context.beginPath();
  points.forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.closePath();
}

function drawField(context, game, camera, colours, options) {
  const [width, height] = game.meta.env_bounds_m;
  const teams = [colours.blue, colours.red];
  const corners = [[0, 0], [width, 0], [width, height], [0, height]].map(([x, y]) => [camera.x(x), camera.y(y)]);
  context.save();
  polygon(context, corners);
  context.clip();
  drawHalves(context, game, camera, colours);
  context.strokeStyle = colours.grid;
  context.lineWidth = 1;
  for (let x = 10; x < width; x += 10) drawLine(context, camera, x, 0, x, height);
  for (let y = 10; y < height; y += 10) drawLine(context, camera, 0, y, width, y);
  if (hasFlags(game)) drawScrimmage(context, game, camera, colours);
  game.meta.flag_home.forEach(([x, y], team) => {
    if (options.tag) {
      fillAndRing(context, camera, x, y, game.meta.catch_radius_m, teams[team], 0.1, 1, [5, 5]);
    }
    if (game.meta.flag_keepout_m > 0) {
      fillAndRing(context, camera, x, y, game.meta.flag_keepout_m, teams[team], 0.14, 1, []);
    }
  });
  drawObstacles(context, game, camera, colours);
  context.restore();
  polygon(context, corners);
  context.strokeStyle = colours.edge;
  context.lineWidth = 1.5;
  context.stroke();
}

function drawHalves(context, game, camera, colours) {
  const [a, b] = game.meta.scrimmage;
  const far = 4 * Math.max(...game.meta.env_bounds_m);
  const length = Math.hypot(b[0] - a[0], b[1] - a[1]);
  const along = [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
  context.fillStyle = colours.redWater;
  context.fillRect(0, 0, camera.width, camera.height);
  const home = game.meta.flag_home[0];
  const side = Math.sign(along[0] * (home[1] - a[1]) - along[1] * (home[0] - a[0])) || 1;
  const across = [-along[1] * side, along[0] * side];
  const half = [[-1, 0], [1, 0], [1, 1], [-1, 1]].map(([s, t]) => [
    camera.x(a[0] + far * (s * along[0] + t * across[0])), camera.y(a[1] + far * (s * along[1] + t * across[1]))]);
  context.fillStyle = colours.blueWater;
  polygon(context, half);
  context.fill();
}

function drawScrimmage(context, game, camera, colours) {
  const [a, b] = game.meta.scrimmage;
  const far = 4 * Math.max(...game.meta.env_bounds_m) / Math.hypot(b[0] - a[0], b[1] - a[1]);
  context.strokeStyle = colours.edge;
  context.lineWidth = 1.5;
  context.setLineDash([8, 8]);
  drawLine(context, camera, a[0] - far * (b[0] - a[0]), a[1] - far * (b[1] - a[1]),
    a[0] + far * (b[0] - a[0]), a[1] + far * (b[1] - a[1]));
  context.setLineDash([]);
}

function drawLine(context, camera, x1, y1, x2, y2) {
  context.beginPath();
  context.moveTo(camera.x(x1), camera.y(y1));
  context.lineTo(camera.x(x2), camera.y(y2));
  context.stroke();
}

function fillAndRing(context, camera, x, y, radius, colour, opacity, width, dash) {
  circle(context, camera, x, y, radius);
  context.globalAlpha = opacity;
  context.fillStyle = colour;
  context.fill();
  context.globalAlpha = Math.min(1, opacity + 0.6);
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.stroke();
  context.setLineDash([]);
  context.globalAlpha = 1;
}

function drawObstacles(context, game, camera, colours) {
  context.fillStyle = colours.obstacle;
  for (const [radius, [x, y]] of game.meta.obstacles.circle || []) {
    circle(context, camera, x, y, radius);
    context.fill();
  }
  for (const corners of game.meta.obstacles.polygon || []) {
    polygon(context, corners.map(([x, y]) => [camera.x(x), camera.y(y)]));
    context.fill();
  }
}

function drawTrail(context, game, camera, boat, step, pose, seconds, colour) {
  const steps = Math.round(seconds / game.dt), stride = Math.max(1, Math.round(steps / 150));
  context.strokeStyle = colour;
  context.lineWidth = 2;
  context.lineCap = "round";
  let previous = pose;
  for (let k = 0; k < steps && step - k >= 0; k += stride) {
    const x = game.state("position", 2 * boat, step - k), y = game.state("position", 2 * boat + 1, step - k);
    context.globalAlpha = 0.75 * (1 - k / steps) ** 1.5;
    drawLine(context, camera, previous.x, previous.y, x, y);
    previous = { x, y };
  }
  context.globalAlpha = 1;
}

function drawArrow(context, camera, pose, speed, heading, colour, width) {
  if (!Number.isFinite(speed) || !Number.isFinite(heading)) return;
  const turn = heading * Math.PI / 180, length = speed * LOOKAHEAD_S * camera.scale;
  const head = Math.min(length, 5 + 2.6 * width);
  if (length < 2) return;
  context.save();
  context.translate(camera.x(pose.x), camera.y(pose.y));
  context.rotate(turn);
  context.fillStyle = colour;
  polygon(context, [[-width / 2, 0], [-width / 2, -length + head * 0.85], [-head * 0.48, -length + head * 0.85],
    [0, -length], [head * 0.48, -length + head * 0.85], [width / 2, -length + head * 0.85], [width / 2, 0]]);
  context.fill();
  context.restore();
}

function drawCommand(context, game, camera, boat, step, pose, colours, teamColour) {
  if (game.steps === 0) return;
  const filtered = [game.command("filtered_speed", boat, step), game.command("filtered_heading", boat, step)];
  if (!game.intervened(boat, step)) {
    context.globalAlpha = 0.75;
    drawArrow(context, camera, pose, ...filtered, teamColour, 1.6);
    context.globalAlpha = 1;
    return;
  }
  const nominal = [game.command("nominal_speed", boat, step), game.command("nominal_heading", boat, step)];
  drawArrow(context, camera, pose, ...nominal, colours.nominal, 1.8);
  drawArrow(context, camera, pose, ...filtered, colours.changed, 4.6);
}

function drawHull(context, game, camera, boat, step, pose, colours, teamColour) {
  const size = Math.max(1.5 * camera.scale, 22);
  const tagged = game.bit(boat, step, TAGGED);
  context.save();
  context.translate(camera.x(pose.x), camera.y(pose.y));
  context.rotate(pose.heading * Math.PI / 180);
  polygon(context, HULL.map(([x, y]) => [x * size, -y * size]));
  context.fillStyle = tagged ? colours.card : teamColour;
  context.fill();
  context.strokeStyle = tagged ? teamColour : colours.card;
  context.lineWidth = 1.4;
  context.stroke();
  context.restore();
  if (!tagged) return;
  const reach = size * 0.26, x = camera.x(pose.x), y = camera.y(pose.y);
  context.strokeStyle = colours.ink;
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(x - reach, y - reach); context.lineTo(x + reach, y + reach);
  context.moveTo(x - reach, y + reach); context.lineTo(x + reach, y - reach);
  context.stroke();
}

function drawFlag(context, camera, x, y, colour, pole) {
  const left = camera.x(x), foot = camera.y(y);
  polygon(context, [[left, foot - 22], [left + 15, foot - 17], [left, foot - 12]]);
  context.fillStyle = colour;
  context.fill();
  context.strokeStyle = pole;
  context.lineWidth = 1.8;
  context.beginPath();
  context.moveTo(left, foot);
  context.lineTo(left, foot - 22);
  context.stroke();
}

/** Pairs of boats within the separation radius, and whether one of them is of the team whose violations count. */
function pairsInViolation(game, poses) {
  const pairs = [], isOwn = (boat) => game.meta.team[boat] === game.ownTeam;
  for (let a = 0; a < poses.length; a++) {
    for (let b = a + 1; b < poses.length; b++) {
      const gap = Math.hypot(poses[a].x - poses[b].x, poses[a].y - poses[b].y);
      if (gap <= game.meta.separation_m) pairs.push({ boats: [a, b], gap, own: isOwn(a) || isOwn(b) });
    }
  }
  return pairs;
}

/** The disc of half the radius. A violation of the team that counts pulses, with a ring in the boat's own colour. */
function drawSeparation(context, game, camera, boat, step, pose, colours, teamColour, violation, pulse) {
  const radius = game.meta.separation_m / 2;
  if (violation && violation.own) {
    fillAndRing(context, camera, pose.x, pose.y, radius * (1 + 0.5 * pulse), colours.violation, 0.4 - 0.25 * pulse, 2.5, []);
    fillAndRing(context, camera, pose.x, pose.y, radius, teamColour, 0, 2.5, []);
  } else if (violation) {
    fillAndRing(context, camera, pose.x, pose.y, radius, teamColour, 0.12, 1.5, [3, 4]);
  } else if (game.intervened(boat, step)) {
    fillAndRing(context, camera, pose.x, pose.y, radius, colours.changed, 0.3, 1.6, []);
  } else {
    fillAndRing(context, camera, pose.x, pose.y, radius, teamColour, 0.08, 1, []);
  }
}

/** Draw a game at a time. Returns what the pane shows beside the picture. */
function drawMoment(context, game, camera, time, colours, options, pulse) {
  const { step, share } = game.at(time);
  const poses = Array.from({ length: game.boats }, (_, boat) => game.pose(boat, step, share));
  const teamColour = (boat) => (game.meta.team[boat] === 0 ? colours.blue : colours.red);
  const violations = pairsInViolation(game, poses), inViolation = new Map();
  for (const violation of [...violations].sort((a, b) => a.own - b.own)) violation.boats.forEach((boat) => inViolation.set(boat, violation));
  context.clearRect(0, 0, camera.width, camera.height);
  drawField(context, game, camera, colours, options);
  poses.forEach((pose, boat) => {
    drawTrail(context, game, camera, boat, step, pose, options.trail, teamColour(boat));
  });
  poses.forEach((pose, boat) => {
    if (options.tag && boat === options.followed) {
      fillAndRing(context, camera, pose.x, pose.y, game.meta.catch_radius_m, teamColour(boat), 0.05, 1, [3, 5]);
    }
    if (!options.separation && !inViolation.has(boat)) return;
    drawSeparation(context, game, camera, boat, step, pose, colours, teamColour(boat), inViolation.get(boat), pulse);
  });
  if (options.commands) {
    poses.forEach((pose, boat) => drawCommand(context, game, camera, boat, step, pose, colours, teamColour(boat)));
  }
  poses.forEach((pose, boat) => drawHull(context, game, camera, boat, step, pose, colours, teamColour(boat)));
  for (const team of [0, 1]) {
    const x = game.state("flag_position", 2 * team, step), y = game.state("flag_position", 2 * team + 1, step);
    drawFlag(context, camera, x, y, team === 0 ? colours.blue : colours.red, colours.ink);
  }
  if (options.names) {
    drawLabels(context, game, camera, step, poses, colours, teamColour);
  }
  return { step, poses, violations };
}
