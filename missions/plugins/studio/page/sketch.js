// A tree as a small drawing, for lists.

import { svg } from "./dom.js";

const STEP = 10; // units between leaves, and between levels

/** Return the drawing of a tree, given the depth of each node in the order of the file. */
export function sketch(depths) {
  const above = [];
  const nodes = depths.map((depth) => ({ depth, children: [] }));
  for (const node of nodes) {
    above.length = node.depth;
    above.at(-1)?.children.push(node);
    above.push(node);
  }
  let leaves = 0;
  for (const node of nodes) if (!node.children.length) node.x = leaves++;
  for (const node of nodes.toReversed()) node.x ??= (node.children[0].x + node.children.at(-1).x) / 2;
  const at = ({ x, depth }) => `${x * STEP} ${depth * STEP}`;
  const lines = nodes.flatMap((node) => node.children.map((child) => `M${at(node)}L${at(child)}`));
  const [wide, high] = [leaves * STEP, (Math.max(...depths) + 1) * STEP];
  return svg("svg", { class: "sketch", viewBox: `${-STEP / 2} ${-STEP / 2} ${wide} ${high}`, "aria-hidden": "true" },
    svg("path", { d: lines.join("") }), svg("path", { class: "dots", d: nodes.map((node) => `M${at(node)}h0`).join("") }));
}
