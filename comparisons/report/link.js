// What is shown as the fragment of the page's address, which can be sent to others.

const LINK_MILLISECONDS = 300;
/** Values that are not written. */
const DEFAULTS = { view: "side", of: "candidate", pair: "0,1", stops: "0", colours: "srgb", sort: "rank", order: "up", cases: "list" };

/** The state in an address's fragment; null if it is none of ours. */
function readFragment(fragment) {
  const text = fragment.replace(/^#/, "");
  return text.includes("=") ? Object.fromEntries(new URLSearchParams(text)) : null;
}

/** The fragment of a state: what is empty or as usual is left out. */
function writeFragment(state) {
  const kept = Object.entries(state).filter(([key, value]) => value !== "" && value !== DEFAULTS[key]);
  return new URLSearchParams(kept.map(([key, value]) => [key, String(value)])).toString();
}

/** Calls `state` after changes, and puts what it returns into the address, not too often. */
class Address {
  constructor(state) {
    this.state = state;
    this.waiting = null;
  }

  changed() {
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.write(), LINK_MILLISECONDS);
  }

  write() {
    const fragment = writeFragment(this.state());
    try {
      history.replaceState(null, "", fragment ? `#${fragment}` : location.pathname + location.search);
    } catch {
      // A browser that does not allow it for files: the page works without.
    }
  }
}
