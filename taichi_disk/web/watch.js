// Visitors who watch: a bar says so and lets them ask to play; a note tells the player, who hands
// over or does not.

import { element } from "./html.js";

export class Watch {
  // `node` and `role` are elements of the page: the whole and the line for the visitor's role.
  constructor(node, role, send) {
    this.node = node;
    this.role = role;
    const button = (text, command) =>
      element("button", { textContent: text, onclick: () => send({ do: command }), hidden: true });
    this.ask = button("Ask to play", "ask");
    this.hand = button("Hand over", "hand");
    this.keep = button("Not now", "keep");
    role.after(this.ask, this.hand, this.keep);
  }

  // `plays`: whether this visitor plays; `asks`: whether this visitor has asked to; `asking`:
  // number of those who have.
  show({ plays, asks, asking }) {
    this.node.toggleAttribute("data-watching", !plays);
    this.role.textContent = plays ? requests(asking) : "You are watching.";
    this.ask.hidden = plays;
    this.ask.disabled = asks;
    this.ask.textContent = asks ? "You have asked to play" : "Ask to play";
    this.hand.hidden = this.keep.hidden = !plays || asking === 0;
  }
}

function requests(asking) {
  if (asking === 0) return "";
  return asking === 1 ? "A watcher asks to play." : `${asking} watchers ask to play.`;
}
