// A task's plan space as a layered graph.

class SpacePicture {
  constructor(task, onNode) {
    this.task = task;
    const { state, step, order } = task.nodes;
    const sizes = Array(task.steps + 1).fill(0);
    step.forEach(k => { sizes[k]++; });
    const most = Math.max(...sizes);
    const row = most <= 14 ? 34 : most <= 30 ? 24 : most <= 70 ? 14 : 7, column = Math.max(46, Math.min(most > 10 ? 170 : 92, 1050 / (task.steps + 1)));
    const width = Math.min(30, row + 2), height = Math.max(4, row - 8);
    const w = column * (task.steps + 1), h = row * most + 30;
    this.point = node => [column * (step[node] + .5), 26 + row * (order[node] + .5 + (most - sizes[step[node]]) / 2)];
    this.svg = draw('svg', { viewBox: `0 0 ${w} ${h}`, width: w, height: h, role: 'img',
      'aria-label': `Plan space: ${state.length} nodes in ${task.steps + 1} columns, one for each step` });
    this.column = this.svg.appendChild(draw('rect', { class: 'column-now', y: 0, width: column, height: h, rx: 6 }));
    this.columnWidth = column;
    for (let k = 0; k <= task.steps; k++) {
      this.svg.append(draw('text', { class: 'axis', x: column * (k + .5), y: 15 }, k === 0 ? 'start' : k === task.steps ? 'goal' : k));
    }
    this.source = [];
    for (let n = 0; n < state.length; n++) for (let e = task.first[n]; e < task.first[n + 1]; e++) this.source[e] = n;
    this.paths = ['e-all', 'e-fit', 'e-plan'].map(name => this.svg.appendChild(draw('path', { class: name })));
    this.paths[0].setAttribute('d', this.lines(this.source.keys()));
    this.groups = state.map((s, node) => {
      const [x, y] = this.point(node), word = DATA.state_words[s];
      const shapes = wordShape('rect', { x: x - width / 2, y: y - height / 2, width, height, rx: Math.min(5, height / 3) }, word);
      const label = height >= 12 ? draw('text', { x, y: y + Math.min(14, height * .7) * .36, class: 'w-name', 'font-size': Math.min(14, height * .7) }, wordShort(word)) : null;
      return this.svg.appendChild(draw('g', { class: 'n', 'data-node': node, onclick: () => onNode(node) },
        draw('title', {}, `step ${step[node]}, ${DATA.words[word].name}: ${told(s)}`), ...shapes, label));
    });
  }

  lines(edges) {
    const seen = new Set(), parts = [];
    for (const edge of edges) {
      const a = this.source[edge], b = this.task.target[edge], key = `${a},${b}`;
      if (seen.has(key)) continue;
      seen.add(key);
      const [x0, y0] = this.point(a), [x1, y1] = this.point(b), mid = (x0 + x1) / 2;
      parts.push(`M${x0} ${y0}C${mid} ${y0} ${mid} ${y1} ${x1} ${y1}`);
    }
    return parts.join('');
  }

  fits(fits) {
    this.paths[1].setAttribute('d', fits.edges.size === this.task.target.length ? '' : this.lines(fits.edges));
    this.groups.forEach((group, node) => group.classList.toggle('off', !fits.nodes.has(node)));
  }

  plan(edges, step) {
    this.paths[2].setAttribute('d', this.lines(edges));
    const nodes = [0, ...edges.map(edge => this.task.target[edge])], on = new Set(nodes);
    this.groups.forEach((group, node) => {
      group.classList.toggle('on-plan', on.has(node));
      group.classList.toggle('now', node === nodes[step]);
    });
    this.column.setAttribute('x', this.columnWidth * step);
  }
}
