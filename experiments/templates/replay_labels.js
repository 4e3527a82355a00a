// Labels at the boats, kept clear of the boats and of each other.

const LABEL_FONT = "12px system-ui, 'DejaVu Sans', sans-serif";

function overlap(a, b) {
  const wide = Math.min(a.x + a.w, b.x + b.w) - Math.max(a.x, b.x);
  const high = Math.min(a.y + a.h, b.y + b.h) - Math.max(a.y, b.y);
  return wide > 0 && high > 0 ? wide * high : 0;
}

/** The first place around a spot that nothing has taken, else the one that covers least. */
function freePlace(spot, width, height, reach, taken) {
  let best = null, least = Infinity;
  for (const far of [2, 12, 26, 44]) {
    for (let turn = 0; turn < 360; turn += 30) {
      const angle = turn * Math.PI / 180;
      const x = spot.x + Math.sin(angle) * (reach + far + width / 2) - width / 2;
      const y = spot.y - Math.cos(angle) * (reach + far + height / 2) - height / 2;
      const place = { x, y, w: width, h: height };
      const covered = taken.reduce((sum, other) => sum + overlap(place, other), 0);
      if (covered === 0) return place;
      if (covered < least) [best, least] = [place, covered];
    }
  }
  return best;
}

/** Boxes over the flags and along the arrows of changed commands. */
function marksToKeepClear(game, camera, step, poses) {
  const boxes = [];
  for (const team of [0, 1]) {
    const x = camera.x(game.state("flag_position", 2 * team, step));
    const y = camera.y(game.state("flag_position", 2 * team + 1, step));
    boxes.push({ x: x - 4, y: y - 24, w: 22, h: 26 });
  }
  poses.forEach((pose, boat) => {
    if (!game.intervened(boat, step)) return;
    for (const name of ["nominal", "filtered"]) {
      const turn = game.command(`${name}_heading`, boat, step) * Math.PI / 180;
      const length = game.command(`${name}_speed`, boat, step) * LOOKAHEAD_S * camera.scale;
      if (!Number.isFinite(length)) continue;
      for (let share = 0.1; share < 1.05; share += 0.1) {
        const x = camera.x(pose.x) + Math.sin(turn) * length * share;
        const y = camera.y(pose.y) - Math.cos(turn) * length * share;
        boxes.push({ x: x - 4, y: y - 4, w: 8, h: 8 });
      }
    }
  });
  return boxes;
}

function drawLabels(context, game, camera, step, poses, colours, teamColour) {
  const reach = Math.max(game.meta.separation_m / 2 * camera.scale, 11);
  const spots = poses.map((pose) => ({ x: camera.x(pose.x), y: camera.y(pose.y) }));
  const taken = spots.map(({ x, y }) => ({ x: x - reach, y: y - reach, w: 2 * reach, h: 2 * reach }));
  taken.push(...marksToKeepClear(game, camera, step, poses));
  const changed = spots.map((_, boat) => game.intervened(boat, step));
  const order = [...spots.keys()].sort((a, b) => changed[b] - changed[a]);
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.lineJoin = "round";
  for (const boat of order) {
    context.font = `${changed[boat] ? 600 : 700} ${LABEL_FONT}`;
    const text = changed[boat] ? `${boat} ${game.reasonText(game.command("reason", boat, step))}` : String(boat);
    const place = freePlace(spots[boat], context.measureText(text).width + 4, 15, reach, taken);
    taken.push(place);
    context.lineWidth = 3.5;
    context.strokeStyle = colours.card;
    context.strokeText(text, place.x + place.w / 2, place.y + place.h / 2);
    context.fillStyle = changed[boat] ? colours.changed : teamColour(boat);
    context.fillText(text, place.x + place.w / 2, place.y + place.h / 2);
  }
}
