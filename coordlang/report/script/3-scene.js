// A map with its things: drawn once, then moved.

const CELL = 100;

// share: the part of the places whose boxes touch none, where the map would be too wide if no boxes touched.
function mapGeometry(share = .5) {
  const { places, grid } = DATA;
  const width = grid ? CELL - 6 : 124, height = grid ? CELL - 6 : 88;
  const [left, right] = [Math.min, Math.max].map(end => end(...places.map(p => p.x))), top = Math.min(...places.map(p => p.y));
  // From these scales on a place's box touches none.
  const apart = (grid ? [] : places).map(a => Math.max(...places.map(b => (a === b ? 0
    : Math.min(420, 1 / Math.max(Math.abs(a.x - b.x) / 150, Math.abs(a.y - b.y) / 124, 1e-6)))))).sort((a, b) => a - b);
  const fits = Math.max(1600 / (right - left), apart[Math.floor((apart.length - 1) * share)]);
  const scale = grid ? CELL : Math.min(fits, Math.max(150, apart.at(-1)));
  const centre = places.map(p => [(p.x - left) * scale + width / 2 + 8, (p.y - top) * scale + height / 2 + 8]);
  return { width, height, centre,
    size: [Math.max(...centre.map(c => c[0])) + width / 2 + 8, Math.max(...centre.map(c => c[1])) + height / 2 + 8] };
}

class Scene {
  // marks: names of marks (atoms about one place) that are worth showing; names: write the places' names.
  constructor(label, marks, names) {
    this.names = names;
    this.geometry = mapGeometry();
    this.marks = marks;
    const [width, height] = this.geometry.size;
    this.svg = draw('svg', { viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': label,
      style: `max-width:${Math.round(width * (DATA.grid ? 1.5 : 1.15))}px` });
    this.layers = Object.fromEntries(['ground', 'trails', 'goals', 'arrows', 'tokens', 'over'].map(name =>
      [name, this.svg.appendChild(draw('g', {}))]));
    this.places = []; this.tokens = new Map();
    this.drawGround();
  }

  drawGround() {
    const { width, height, centre } = this.geometry, ground = this.layers.ground;
    const line = ([a, b], name) => draw('line', { x1: centre[a][0], y1: centre[a][1], x2: centre[b][0], y2: centre[b][1], class: name });
    const touch = ([a, b]) => DATA.grid && Math.abs(centre[a][0] - centre[b][0]) + Math.abs(centre[a][1] - centre[b][1]) < CELL + 1;
    for (const link of DATA.links) {
      if (DATA.grid && touch(link)) continue;
      if (DATA.grid) ground.append(line(link, 'hall-edge'), line(link, 'hall'));
      else ground.append(line(link, link[2] ? 'passage' : 'passage still'));
    }
    DATA.places.forEach((place, number) => {
      const [x, y] = centre[number], left = x - width / 2, top = y - height / 2;
      const box = draw('rect', { x: left, y: top, width, height, rx: DATA.grid ? 7 : 14, class: 'place' }, draw('title', {}, place.name));
      const name = draw('text', { x: left + 7, y: top + 15, class: 'place-name' }, this.names ? cut(place.name, 15) : '');
      const mark = draw('text', { x: left + 8, y: top + height - 8, class: 'mark' });
      const tint = draw('text', { x: left + width - 14, y: top + height - 10, class: 'tint-name' });
      const hatch = draw('rect', { x: left, y: top, width, height, rx: DATA.grid ? 7 : 14, class: 'w-hatch', fill: 'none' });
      ground.append(box, name, hatch, mark, tint);
      this.places.push({ box, hatch, mark, tint });
    });
    if (DATA.grid) this.drawWalls(touch);
  }

  drawWalls(touch) {
    const linked = new Set(DATA.links.map(([a, b]) => `${a},${b}`)), { centre } = this.geometry;
    for (let a = 0; a < centre.length; a++) {
      for (let b = a + 1; b < centre.length; b++) {
        if (!touch([a, b]) || linked.has(`${a},${b}`) || linked.has(`${b},${a}`)) continue;
        const x = (centre[a][0] + centre[b][0]) / 2, y = (centre[a][1] + centre[b][1]) / 2, half = CELL / 2 - 4;
        const across = centre[a][1] === centre[b][1];
        this.layers.ground.append(draw('line', { class: 'wall', x1: across ? x : x - half, x2: across ? x : x + half,
          y1: across ? y - half : y, y2: across ? y + half : y }));
      }
    }
  }

  goals(goals) {
    const inPlace = new Map();
    for (const [thing, place] of goals) inPlace.set(place, [...(inPlace.get(place) || []), thing]);
    this.layers.goals.replaceChildren(...[...inPlace].flatMap(([place, things]) => things.flatMap((thing, k) => {
      const [x, y, scale] = this.spot(place, k, things.length), name = cut(DATA.things[thing], 5);
      const size = Math.min(19, 84 / Math.max(name.length, 2)) * scale;
      return [draw('circle', { cx: x, cy: y, r: 32 * scale, class: `goal ${this.paint(thing)}` }, draw('title', {}, `goal of ${DATA.things[thing]}`)),
        draw('text', { x, y: y + size * .35, 'font-size': size, class: `goal-name ${this.paint(thing)}` }, name)];
    })));
  }

  paint(thing) { return thing < DATA.robots.length ? robotClass(thing) : ''; }

  // states: of the whole plan; the part up to `step` is drawn strongly.
  trails(states, step) {
    const shift = robot => (robot - (DATA.robots.length - 1) / 2) * 9;
    const path = (robot, from, to) => {
      const points = states.slice(from, to + 1).map(state => placeOf(state, robot)).filter(place => place !== undefined)
        .map(place => this.geometry.centre[place].map(v => v + shift(robot)).join(' '));
      return points.length > 1 ? `M${points.join('L')}` : '';
    };
    this.layers.trails.replaceChildren(...DATA.robots.flatMap((_, robot) => [
      draw('path', { class: `trail ${robotClass(robot)}`, d: path(robot, 0, states.length - 1) }),
      draw('path', { class: `trail done ${robotClass(robot)}`, d: path(robot, 0, step) })]));
  }

  show(state, faded, label) {
    const { at, carried } = whereIs(state);
    const inPlace = new Map();
    for (const [thing, place] of [...at].sort((a, b) => a[0] - b[0])) {
      if (!inPlace.has(place)) inPlace.set(place, []);
      inPlace.get(place).push(thing);
    }
    this.spots = new Map();
    for (const [place, things] of inPlace) {
      things.forEach((thing, k) => this.spots.set(thing, this.spot(place, k, things.length)));
    }
    const riders = new Map();
    for (const [thing, by] of carried) {
      const [x, y, size] = this.spots.get(by), rank = riders.get(by) || 0;
      riders.set(by, rank + 1);
      this.spots.set(thing, [x + 24 * size, y + (20 - 34 * rank) * size, size * .62]);
    }
    DATA.things.forEach((name, thing) => this.token(thing, name, at, carried, faded));
    for (const thing of carried.keys()) this.layers.tokens.append(this.tokens.get(thing));
    this.places.forEach(({ mark }) => { mark.textContent = ''; });
    for (const fact of DATA.states[state]) {
      const { role } = DATA.facts[fact];
      if (role[0] !== 'mark' || !this.marks.has(role[2])) continue;
      const { mark } = this.places[role[1]];
      mark.textContent += (mark.textContent ? ', ' : '') + role[2];
    }
    this.svg.setAttribute('aria-label', label);
  }

  spot(place, k, number) {
    const [x, y] = this.geometry.centre[place], drop = DATA.grid ? 0 : 6;
    if (number === 1) return [x, y + drop, 1];
    if (number === 2) return [x + (k ? 22 : -22), y + drop, .74];
    const angle = (k / number) * 2 * Math.PI - Math.PI / 2, away = number > 4 ? 28 : 24;
    return [x + away * Math.cos(angle) * (DATA.grid ? 1 : 1.35), y + drop + 4 + (away - 4) * Math.sin(angle), number > 4 ? .5 : .6];
  }

  token(thing, name, at, carried, faded) {
    const spot = this.spots.get(thing);
    if (!this.tokens.has(thing)) {
      const robot = thing < DATA.robots.length, text = cut(name, robot ? 5 : 6);
      const shape = robot ? draw('circle', { r: 27 }) : draw('rect', { x: -26, y: -19, width: 52, height: 38, rx: 6 });
      const size = Math.min(23, 68 / Math.max(text.length, 2));
      this.tokens.set(thing, this.layers.tokens.appendChild(draw('g', { class: `token ${this.paint(thing)}`, 'data-thing': name },
        draw('title', {}, name), shape, draw('text', { y: size * .35, 'font-size': size }, text))));
    }
    const group = this.tokens.get(thing);
    group.style.display = spot ? '' : 'none';
    if (!spot) { delete group.dataset.place; return; }
    group.style.transform = `translate(${spot[0]}px, ${spot[1]}px) scale(${spot[2]})`;
    group.dataset.place = DATA.places[at.has(thing) ? at.get(thing) : at.get(carried.get(thing))].name;
    group.classList.toggle('faded', faded.has(thing));
  }

  // arrows: [thing, place, bad?, robot]; crosses: places or things to be crossed out.
  arrows(list, crosses = []) {
    const shapes = list.map(([thing, place, bad, robot]) => {
      const [x0, y0] = this.spots.get(thing) || this.geometry.centre[place];
      const [x1, y1] = this.geometry.centre[place], length = Math.hypot(x1 - x0, y1 - y0);
      if (length < 8) return null;
      const [ux, uy] = [(x1 - x0) / length, (y1 - y0) / length], from = 32, to = Math.max(length - 24, 44);
      const tip = [x0 + ux * to, y0 + uy * to];
      const wing = s => [tip[0] - ux * 13 + uy * s * 9, tip[1] - uy * 13 - ux * s * 9].join(' ');
      return draw('path', { class: `arrow ${bad ? 'bad' : ''} ${robotClass(robot)}`,
        d: `M${x0 + ux * from} ${y0 + uy * from}L${tip.join(' ')}M${wing(1)}L${tip.join(' ')}L${wing(-1)}` });
    });
    this.layers.arrows.replaceChildren(...shapes.filter(Boolean));
    this.layers.over.replaceChildren(...crosses.map(([x, y]) =>
      draw('path', { class: 'cross', d: `M${x - 17} ${y - 17}l34 34m0 -34l-34 34` })));
  }

  // words: place -> word number, or nothing.
  tint(words) {
    this.places.forEach(({ box, hatch, tint }, place) => {
      const word = words ? words.get(place) : undefined, pattern = Math.floor((word ?? 0) / 9) % 4;
      hatch.setAttribute('fill', pattern ? `url(#hatch${pattern})` : 'none');
      box.setAttribute('class', word === undefined ? 'place' : `place tinted ${wordClass(word)}`);
      tint.textContent = word === undefined ? '' : wordShort(word);
    });
  }
}
