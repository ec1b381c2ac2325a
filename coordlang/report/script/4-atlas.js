// All states of the language at once, coloured by word: maps in a map, or a graph of states.

class Atlas {
  constructor(root) {
    this.root = root;
    this.pair = DATA.pair && DATA.pair.things;
    this.views = [];
    this.plan = root.querySelector('.plan');
    if (this.plan) this.preparePlan();
    if (this.pair) this.views.push(this.plan ? ['Floor plan', () => this.floorPlan()] : ['Maps in a map', () => this.nested()]);
    if (DATA.state_graph) this.views.push(['State graph', () => this.graph()]);
    if (!this.views.length) return;
    root.hidden = false;
    const columns = this.plan ? 8 : this.pair ? mapGeometry().size[0] / CELL : 0;
    byId('words').classList.toggle('stacked', DATA.words.length > 8 || columns > 7);
    const tabs = root.querySelector('.tabs');
    if (this.views.length > 1) {
      tabs.append(...this.views.map(([name], k) => make('button', { type: 'button', onclick: () => this.open(k) }, name)));
    }
    this.open(0);
  }

  open(view) {
    [...this.root.querySelectorAll('.tabs button')].forEach((b, k) => b.setAttribute('aria-pressed', k === view));
    this.groups = new Map();
    const [svg, caption] = this.views[view][1]();
    if (this.plan) this.root.querySelector('#plan-choice').hidden = svg !== this.plan;
    svg.setAttribute('tabindex', 0);
    svg.onkeydown = event => (svg === this.plan ? this.walk(event) : this.key(event));
    this.root.querySelector('#atlas-picture').replaceChildren(svg);
    this.root.querySelector('#atlas-caption').textContent = caption;
    if (svg !== this.plan) this.pick(null);
    this.only(this.word ?? null);
    this.now(this.current ?? null);
  }

  nested() {
    const { centre, size, width, height } = mapGeometry(1), [one, two] = this.pair;
    const inner = Math.min((width - 6) / size[0], (height - (DATA.grid ? 6 : 20)) / size[1]);
    const svg = draw('svg', { viewBox: `0 0 ${size[0]} ${size[1]}`, role: 'img', 'aria-label':
      `For every place of ${DATA.things[one]} a small map; its cells are coloured by the word when ${DATA.things[two]} is there` });
    const drop = (height - size[1] * inner) / 2;
    const spot = (a, b) => [centre[a][0] - size[0] * inner / 2 + centre[b][0] * inner,
      centre[a][1] - height / 2 + drop + centre[b][1] * inner + (DATA.grid ? 0 : 6)];
    const w = width * inner * (DATA.grid ? 1 : .96), h = height * inner;
    centre.forEach(([x, y], a) => {
      svg.append(draw('rect', { x: x - width / 2, y: y - height / 2, width, height, rx: 7, class: 'outer' }));
      if (!DATA.grid) svg.append(draw('text', { x: x - width / 2 + 8, y: y - height / 2 + 16, class: 'outer-name' }, cut(DATA.places[a].name, 15)));
      centre.forEach((_, b) => {
        const [cx, cy] = spot(a, b);
        svg.append(draw('rect', { x: cx - w / 2, y: cy - h / 2, width: w, height: h, rx: w / 14, class: 'unmapped' }));
      });
    });
    for (let state = 0; state < DATA.mapped; state++) {
      const { at } = whereIs(state), [cx, cy] = spot(at.get(one), at.get(two)), word = DATA.state_words[state];
      const geometry = { x: cx - w / 2, y: cy - h / 2, width: w, height: h, rx: w / 14 };
      const size = Math.min(h * .62, w * .5);
      this.add(svg, state, word, wordShape('rect', geometry, word), size > 5.5 ? [cx, cy + size * .36, size] : null);
    }
    svg.style.setProperty('--ring', `${Math.max(1.2, w / 9)}px`);
    return [svg, `Each box is a place of ${DATA.things[one]}; the cells in it are the places of ${DATA.things[two]}, coloured by the `
      + 'word of that state. Empty cells are no states of the language. Click one, or use the arrow keys, to see its state.'];
  }

  // One large map: the first thing's place is chosen, each other place shows the word when the second thing is there.
  preparePlan() {
    const [one, two] = this.pair;
    this.states = new Map();
    for (let state = 0; state < DATA.mapped; state++) {
      const { at } = whereIs(state);
      this.states.set(`${at.get(one)},${at.get(two)}`, state);
    }
    this.chosen = DATA.pair.start;
    this.spots = [...this.plan.querySelectorAll('.spot')];
    this.spots.forEach((spot, place) => spot.addEventListener('click', () => this.choose(place)));
    this.select = this.root.querySelector('#plan-place');
    this.select.replaceChildren(...DATA.places.map((place, number) => make('option', { value: number }, place.name)));
    this.select.addEventListener('change', () => this.choose(+this.select.value));
  }

  floorPlan() {
    this.choose(this.chosen);
    return [this.plan, `Click a place, use the arrow keys or choose it above: ${DATA.things[this.pair[0]]} is then there. Places without a colour are no states of the language.`];
  }

  choose(chosen) {
    this.chosen = chosen; this.select.value = chosen;
    this.groups = new Map();
    this.spots.forEach((spot, place) => {
      const state = this.states.get(`${chosen},${place}`), word = state === undefined ? null : DATA.state_words[state];
      const [title, circle, hatch, text] = spot.children, pattern = Math.floor(word / 9) % 4, small = circle.r.baseVal.value < 7;
      const who = place === chosen ? `${DATA.things[this.pair[0]]} at ${DATA.places[place].name}` : DATA.places[place].name;
      title.textContent = word === null ? who : `${DATA.words[word].name}: ${told(state)}`;
      circle.setAttribute('class', word !== null ? `w ${wordClass(word)}` : place === chosen ? 'here' : 'unmapped');
      hatch.setAttribute('fill', word !== null && pattern ? `url(#hatch${pattern})` : 'none');
      text.textContent = word === null || small ? '' : wordShort(word);
      spot.classList.toggle('chosen', place === chosen);
      if (word !== null) this.groups.set(state, spot);
    });
    const words = new Set([...this.groups.keys()].map(state => DATA.state_words[state]));
    this.root.querySelector('.readout').textContent = `${DATA.things[this.pair[0]]} at ${DATA.places[chosen].name}: ${counted(words.size, 'word')}`;
    this.only(this.word ?? null);
    this.now(this.current ?? null);
  }

  // An arrow key goes to the nearest place in its direction.
  walk(event) {
    const way = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowDown: [0, 1], ArrowUp: [0, -1] }[event.key];
    if (!way) return;
    event.preventDefault(); event.stopPropagation();
    const here = DATA.places[this.chosen], far = DATA.places.map(({ x, y }) => {
      const along = (x - here.x) * way[0] + (y - here.y) * way[1], aside = Math.abs((x - here.x) * way[1] + (y - here.y) * way[0]);
      return along > 0 ? along + 2 * aside : Infinity;
    });
    const next = far.indexOf(Math.min(...far));
    if (far[next] < Infinity) this.choose(next);
  }

  graph() {
    const { points, links, steps, radius } = DATA.state_graph, pad = 2 * radius;
    const [right, bottom] = [0, 1].map(axis => Math.max(...points.map(p => p[axis])));
    const svg = draw('svg', { viewBox: `${-pad} ${-pad} ${right + 2 * pad} ${bottom + 2 * pad}`, role: 'img',
      'aria-label': `Graph of ${points.length} joint states, coloured by word` });
    svg.append(draw('path', { class: 'state-link', 'stroke-width': links.length > 900 ? .7 : 1.6,
      d: links.map(([a, b]) => `M${points[a].join(' ')}L${points[b].join(' ')}`).join('') }));
    points.forEach(([x, y], state) => {
      const word = DATA.state_words[state];
      this.add(svg, state, word, wordShape('circle', { cx: x, cy: y, r: radius }, word), [x, y + radius * .36, radius]);
    });
    svg.style.setProperty('--ring', `${Math.max(3, radius / 4)}px`);
    svg.style.maxWidth = `${Math.round(180 + 130 * Math.sqrt(points.length))}px`;
    const lines = links.length || !steps ? 'lines are joint steps between them, one way or both' : `their ${grouped(steps)} joint steps are not drawn`;
    return [svg, `Each dot is a joint state, coloured by its word; ${lines}. Click one, or use the arrow keys, to see it.`];
  }

  add(svg, state, word, shapes, label) {
    const text = label ? draw('text', { x: label[0], y: label[1], 'font-size': label[2], class: 'w-name' }, wordShort(word)) : null;
    const group = draw('g', { class: 'state', 'data-state': state, onclick: () => this.pick(state) },
      draw('title', {}, `${DATA.words[word].name}: ${told(state)}`), ...shapes, text);
    this.groups.set(state, group);
    svg.append(group);
  }

  pick(state) {
    this.groups.forEach((group, other) => group.classList.toggle('picked', other === state));
    this.picked = state;
    const line = this.root.querySelector('.readout');
    if (state === null) { line.textContent = ''; return; }
    line.replaceChildren(chip(DATA.state_words[state]), ` ${told(state)}`);
  }

  key(event) {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (!step) return;
    event.preventDefault(); event.stopPropagation();
    const states = [...this.groups.keys()], at = states.indexOf(this.picked);
    this.pick(states[(at + step + states.length) % states.length] ?? states[0]);
  }

  only(word) {
    this.word = word;
    if (!this.groups) return;
    if (this.spots) this.spots.forEach(spot => spot.classList.remove('off'));
    this.groups.forEach((group, state) => group.classList.toggle('off', word !== null && DATA.state_words[state] !== word));
  }

  now(state) {
    this.current = state;
    if (this.spots) this.spots.forEach(spot => spot.classList.remove('now'));
    if (this.groups) this.groups.forEach((group, other) => group.classList.toggle('now', other === state));
  }
}
