// The plans of a task that fit a sentence, as a graph; counts are exact (BigInt).

class Fits {
  // words: word numbers, or null for all plans of the task.  Nodes are pairs (task node, words said so far), numbered by step;
  // only those on some fitting plan are kept.  out[k]: pairs [edge, node] in the order of labels.
  constructor(task, wordOf, words) {
    this.task = task;
    const position = words ? (from, at, to) => (wordOf(to) === wordOf(from) ? at : words[at + 1] === wordOf(to) ? at + 1 : -1)
      : () => 0;
    const starts = !words || words[0] === wordOf(0), width = words ? words.length : 1;
    let layer = starts ? [{ node: 0, said: 0, out: [], count: 0n }] : [];
    const layers = [layer];
    for (let step = 0; step < task.steps; step++) {
      const next = new Map();
      for (const { node, said, out } of layer) {
        for (let edge = task.first[node]; edge < task.first[node + 1]; edge++) {
          const to = task.target[edge], then = position(node, said, to);
          if (then < 0) continue;
          const code = to * width + then;
          if (!next.has(code)) next.set(code, { node: to, said: then, out: [], count: 0n });
          out.push([edge, next.get(code)]);
        }
      }
      layer = [...next.values()]; layers.push(layer);
    }
    for (const at of layer) if (at.said === width - 1) at.count = 1n;
    for (const nodes of layers.slice(0, -1).reverse()) {
      for (const at of nodes) {
        at.out = at.out.filter(([, to]) => to.count);
        at.count = at.out.reduce((sum, [, to]) => sum + to.count, 0n);
      }
    }
    const kept = layers.map(nodes => nodes.filter(at => at.count)), all = kept.flat();
    all.forEach((at, number) => { at.number = number; });
    this.node = all.map(at => at.node);
    this.count = all.map(at => at.count);
    this.out = all.map(at => at.out.map(([edge, to]) => [edge, to.number]));
    let end = 0;
    this.layers = kept.map(nodes => [end, end += nodes.length]);
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
