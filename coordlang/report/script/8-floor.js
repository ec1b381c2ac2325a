// Runs of robots with wheels: where they were on the floor, and what happened when.

// Seconds that pass between two pictures are told to be fewer: a run plays at this many times its speed.
const FASTER = 4;

class FloorView {
  constructor(simulated) {
    this.byId = name => document.getElementById(name);
    this.all = simulated;
    const select = this.byId('run-select');
    select.replaceChildren(...simulated.runs.map((run, number) => make('option', { value: number }, `seed ${run.seed}: ${this.ended(run)}`)));
    select.addEventListener('change', () => this.open(+select.value));
    this.transport = new Transport(this.byId('floor-transport'), this.byId('floor'), {
      last: () => this.frames - 1, show: frame => this.show(frame), said: frame => `${this.time(frame).toFixed(1)} s of ${this.time(this.frames - 1).toFixed(1)} s`,
      every: 1000 * simulated.interval / FASTER });
    this.draw();
    this.open(0);
  }

  ended(run) {
    const late = run.late ? `, ${counted(run.late, 'joint step')} late` : '';
    return run.arrived ? `all arrive${late}` : run.collisions ? `${counted(run.collisions, 'collision')}` : 'nobody moves any more';
  }

  time(frame) { return Math.min(frame * this.all.interval, this.run.end); }

  // Metres to the right and up -> pixels to the right and down.
  at([x, y]) { return [(x - this.left) * CELL / this.all.cell, (this.top - y) * CELL / this.all.cell]; }

  draw() {
    const { places, walls, cell, radius, robots } = this.all, points = Object.values(places);
    const xs = [...points.map(p => p[0]), ...walls.flatMap(w => [w[0], w[2]])], ys = [...points.map(p => p[1]), ...walls.flatMap(w => [w[1], w[3]])];
    const edge = walls.length ? cell / 12 : cell * .6;
    this.left = Math.min(...xs) - edge; this.top = Math.max(...ys) + edge;
    const [width, height] = this.at([Math.max(...xs) + edge, Math.min(...ys) - edge]), half = CELL * .47;
    this.size = radius * CELL / cell;
    const svg = draw('svg', { viewBox: `0 0 ${Math.round(width)} ${Math.round(height)}`, role: 'img', style: `max-width:${Math.round(width * 1.3)}px` });
    for (const [name, point] of Object.entries(places)) {
      const [x, y] = this.at(point);
      svg.append(walls.length ? draw('rect', { x: x - half, y: y - half, width: 2 * half, height: 2 * half, rx: 7, class: 'place' }, draw('title', {}, name))
        : draw('circle', { cx: x, cy: y, r: this.size * 1.6, class: 'place' }, draw('title', {}, name)));
      if (points.length <= 60) svg.append(draw('text', { x: x - half + 6, y: y - half + 14, class: 'place-name' }, cut(name, 12)));
    }
    for (const wall of walls) {
      const [[x1, y1], [x2, y2]] = [this.at(wall.slice(0, 2)), this.at(wall.slice(2))];
      svg.append(draw('line', { x1, y1, x2, y2, class: 'wall' }));
    }
    robots.forEach((robot, r) => {
      const place = this.all.goals[robot];
      if (place === undefined) return;
      const [cx, cy] = this.at(places[place]);
      svg.append(draw('circle', { cx, cy, r: this.size + 7, class: `goal ${robotClass(r)}` }, draw('title', {}, `goal of ${robot}`)));
    });
    this.trails = robots.map((_, r) => svg.appendChild(draw('path', { class: `trail done ${robotClass(r)}` })));
    this.discs = robots.map((robot, r) => svg.appendChild(draw('g', { class: `wheeled ${robotClass(r)}`, 'data-thing': robot }, draw('title', {}, robot),
      draw('circle', { r: this.size }), draw('line', { x1: 0, y1: 0, x2: this.size, y2: 0 }), draw('text', { y: 5, 'font-size': 15 }, cut(robot, 4)))));
    this.svg = svg;
    this.byId('floor-stage').replaceChildren(svg);
  }

  open(number) {
    this.transport.pause();
    this.byId('run-select').value = number;
    this.run = this.all.runs[number];
    this.frames = Math.max(...this.run.poses.map(own => own.length));
    this.byId('floor-events').replaceChildren(...this.run.events.map(([time, text, bad]) => make('li', {},
      make('button', { type: 'button', class: bad ? 'bad' : null, 'data-time': time, onclick: () => { this.transport.pause(); this.transport.go(Math.round(time / this.all.interval)); } },
        make('b', {}, `${time.toFixed(1)} s`), ` ${text}`))));
    this.transport.go(0);
  }

  place(group, [x, y, heading], name) {
    const [left, top] = this.at([x, y]);
    group.setAttribute('transform', `translate(${left.toFixed(1)} ${top.toFixed(1)})`);
    group.querySelector('line').setAttribute('transform', `rotate(${(-heading * 180 / Math.PI).toFixed(1)})`);
    return `${name} at ${x.toFixed(2)}, ${y.toFixed(2)} m`;
  }

  show(frame) {
    const { run } = this, now = this.time(frame) + 1e-6, own = poses => poses[Math.min(frame, poses.length - 1)];
    const where = run.poses.map((poses, r) => {
      this.trails[r].setAttribute('d', poses.slice(0, frame + 1).map((pose, k) => `${k ? 'L' : 'M'}${this.at(pose).map(v => v.toFixed(1)).join(' ')}`).join(''));
      return this.place(this.discs[r], own(poses), this.all.robots[r]);
    });
    this.svg.setAttribute('aria-label', where.join('; '));
    this.byId('floor-does').replaceChildren(...this.all.robots.map((robot, r) => {
      const steps = run.steps[r].filter(step => step[0] <= now), last = steps.at(-1);
      const done = run.steps[r].filter(step => step[1] !== null && step[1] <= now).length;
      const doing = last && (last[1] === null || last[1] > now) ? last[2] : 'waits';
      return make('li', { class: robotClass(r) }, make('b', {}, robot), make('span', { class: 'own' }, `${counted(done, 'step')} done, ${done === this.all.makespan ? 'is there' : doing}`));
    }));
    for (const button of this.byId('floor-events').querySelectorAll('button')) {
      button.classList.toggle('ahead', +button.dataset.time > now);
    }
  }
}
