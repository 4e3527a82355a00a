// The still part of a game's timeline: captures above, share of changed commands and violations, time below.

const BAND_TOP = 12, BAND_FOOT = 14;

function drawMarks(context, game, width, height, colours) {
  const foot = height - BAND_FOOT, at = (step) => step / Math.max(game.steps, 1) * width;
  context.fillStyle = colours.button;
  context.fillRect(0, BAND_TOP, width, foot - BAND_TOP);
  drawChanges(context, game, width, foot, colours);
  const own = new Set(game.ownViolations);
  context.fillStyle = colours.violation;
  for (const violation of game.violations) {
    const top = own.has(violation) ? BAND_TOP : foot - 9;
    context.fillRect(at(violation[0]) - 1, top, own.has(violation) ? 2.5 : 1.5, foot - top);
  }
  drawCaptures(context, game, at, width, colours);
  drawTimes(context, game, width, height, foot, colours);
}

function drawChanges(context, game, width, foot, colours) {
  const columns = Math.max(1, Math.min(Math.floor(width), game.steps)), bars = new Float32Array(columns);
  for (let step = 0; step < game.steps; step++) {
    const column = Math.min(columns - 1, Math.floor(step / game.steps * columns));
    let changed = 0;
    for (let boat = 0; boat < game.boats; boat++) changed += game.intervened(boat, step) ? 1 : 0;
    bars[column] = Math.max(bars[column], changed / Math.max(1, game.meta.shielded.length));
  }
  context.fillStyle = colours.changed;
  bars.forEach((share, column) => {
    const tall = Math.min(1, share) * (foot - BAND_TOP - 5);
    if (share > 0) context.fillRect(column * width / columns, foot - tall, width / columns, tall);
  });
}

function drawCaptures(context, game, at, width, colours) {
  let before = [0, 0];
  for (const [step, ...score] of game.captures) {
    score.forEach((count, team) => {
      if (count <= before[team]) return;
      const x = Math.min(at(step), width - 9);
      context.fillStyle = team === 0 ? colours.blue : colours.red;
      polygon(context, [[x, 0], [x + 9, 4], [x, 8]]);
      context.fill();
      context.fillRect(x - 1, 0, 1.5, BAND_TOP);
    });
    before = score;
  }
}

function drawTimes(context, game, width, height, foot, colours) {
  const every = [5, 10, 30, 60, 120, 300, 600, 1800].find((step) => game.duration / step * 45 < width) || 3600;
  context.fillStyle = colours.muted;
  context.font = "10.5px system-ui, 'DejaVu Sans', sans-serif";
  context.textBaseline = "bottom";
  for (let time = 0; time <= game.duration; time += every) {
    const x = time / Math.max(game.duration, 1e-9) * width;
    context.fillRect(Math.min(x, width - 1), foot, 1, 3);
    context.textAlign = x < 12 ? "left" : x > width - 14 ? "right" : "center";
    context.fillText(`${Math.floor(time / 60)}:${String(time % 60).padStart(2, "0")}`, x < 12 ? x + 3 : x, height);
  }
}
