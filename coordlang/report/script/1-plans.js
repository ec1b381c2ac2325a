// The plans of a task that fit a sentence, as a graph; counts are exact (BigInt).

class Fits {
  // words: word numbers, or null for all plans of the task.  Nodes are pairs (task node, words said so far), numbered by step;
  // only those on some fitting plan are kept.  out[k]: pairs [edge, node] in the order of labels.
  constructor(task, wordOf, words) {
    this.task = task;
    const position = words ? (from, at, to) => (wordOf(to) === wordOf(from) ? at : words[at + 1] === wordOf(to) ? at + 1 : -1)
      : () => 0;
    this.node = []; this.out = []; this.layers = [];
    const starts = !words || words[0] === wordOf(0);
    let layer = new Map(starts ? [[0, [0, 0]]] : []);
    const width = words ? words.length : 1, last = width - 1;
    const levels = [layer], links = [];
    for (let step = 0; step < task.steps; step++) {
      const next = new Map(), here = new Map();
      for (const [key, [node, at]] of layer) {
        const found = [];
        for (let edge = task.first[node]; edge < task.first[node + 1]; edge++) {
          const to = task.target[edge], said = position(node, at, to);
          if (said < 0) continue;
          const code = to * width + said;
          if (!next.has(code)) next.set(code, [to, said]);
          found.push([edge, code]);
        }
        here.set(key, found);
      }
      links.push(here); levels.push(next); layer = next;
    }
    const counts = levels.map(() => new Map());
    for (const [key, [, at]] of levels[task.steps]) if (at === last) counts[task.steps].set(key, 1n);
    for (let step = task.steps - 1; step >= 0; step--) {
      for (const [key, found] of links[step]) {
        let sum = 0n;
        for (const [, code] of found) sum += counts[step + 1].get(code) || 0n;
        if (sum) counts[step].set(key, sum);
      }
    }
    this.count = [];
    const number = levels.map(() => new Map());
    levels.forEach((level, step) => {
      const from = this.node.length;
      for (const [key, [node]] of level) {
        if (!counts[step].has(key)) continue;
        number[step].set(key, this.node.length);
        this.node.push(node); this.count.push(counts[step].get(key));
      }
      this.layers.push([from, this.node.length]);
    });
    levels.forEach((level, step) => {
      for (const key of level.keys()) {
        if (!number[step].has(key)) continue;
        this.out.push(step === task.steps ? [] : links[step].get(key).filter(([, code]) => number[step + 1].has(code))
          .map(([edge, code]) => [edge, number[step + 1].get(code)]));
      }
    });
    this.nodes = new Set(this.node);
    this.edges = new Set(this.out.flatMap(found => found.map(([edge]) => edge)));
  }

  get total() { return this.count.length ? this.count[0] : 0n; }

  unrank(rank) {
    const edges = [];
    for (let at = 0; this.out[at].length;) {
      for (const [edge, to] of this.out[at]) {
        if (rank < this.count[to]) { edges.push(edge); at = to; break; }
        rank -= this.count[to];
      }
    }
    return edges;
  }

  rank(edges) {
    let rank = 0n, at = 0;
    for (const wanted of edges) {
      const found = this.out[at].findIndex(([edge]) => edge === wanted);
      if (found < 0) return null;
      for (const [, to] of this.out[at].slice(0, found)) rank += this.count[to];
      at = this.out[at][found][1];
    }
    return rank;
  }

  // The first plan through a task node, or null.
  through(node) {
    const good = new Uint8Array(this.node.length), step = this.task.nodes.step[node];
    const [from, to] = this.layers[step];
    for (let k = from; k < to; k++) good[k] = this.node[k] === node ? 1 : 0;
    for (let k = from - 1; k >= 0; k--) good[k] = this.out[k].some(([, next]) => good[next]) ? 1 : 0;
    if (!this.node.length || !good[0]) return null;
    const edges = [];
    for (let at = 0; this.out[at].length;) {
      const [edge, next] = this.out[at].find(([, n]) => edges.length >= step || good[n]);
      edges.push(edge); at = next;
    }
    return edges;
  }

  // What robot r may do when it may be in any of these nodes: label -> nodes in which it may be then.
  options(robot, nodes) {
    const found = new Map();
    for (const at of nodes) {
      for (const [edge, to] of this.out[at]) {
        const label = this.task.labels[robot][edge];
        if (!found.has(label)) found.set(label, new Set());
        found.get(label).add(to);
      }
    }
    return new Map([...found].sort((a, b) => a[0] - b[0]));
  }
}

// The edge of a task node with these labels, or -1.
function edgeWith(task, node, labels) {
  for (let edge = task.first[node]; edge < task.first[node + 1]; edge++) {
    if (labels.every((label, robot) => task.labels[robot][edge] === label)) return edge;
  }
  return -1;
}

// Random numbers that are the same in every browser.
function randomFrom(seed) {
  let state = seed >>> 0;
  return below => {
    state = (state + 0x6d2b79f5) >>> 0;
    let value = Math.imul(state ^ (state >>> 15), state | 1);
    value ^= value + Math.imul(value ^ (value >>> 7), value | 61);
    return Math.floor((((value ^ (value >>> 14)) >>> 0) / 4294967296) * below);
  };
}

function randomBelow(total, random) {
  let value = 0n, size = 1n;
  while (size < total * 1048576n) { value = value * 65536n + BigInt(random(65536)); size *= 65536n; }
  return value % total;
}
