// A fleet's page: all robots in one picture, and a list of them in which those in trouble stand first.
import { Door } from "./door.js";
import { Panel as Theme } from "./theme.js";
import { Icon, Pill, html, observed, render, useEffect, useRef } from "./ui.js";

const decoder = new TextDecoder();

/** What is known of the robots, as fields that components follow by reading them. */
class Fleet {
  constructor() {
    observed(this, { link: "connecting", refused: false, robots: new Map(), pointed: "", flat: false });
    this.board = this.opened("/fleet/board", [], (data) => this.take(data), (link) => (this.link = link));
    this.view = null;
  }

  /** A connection of the page; both ask for the same token. */
  opened(path, protocols, take, state) {
    return new window.VrsLink(path, protocols, {
      take,
      state: (link) => {
        if (link === "token" && sessionStorage.getItem("token") !== null) {
          this.refused = true;
          sessionStorage.removeItem("token");
        }
        state(link);
      },
    });
  }

  take(data) {
    const message = JSON.parse(typeof data === "string" ? data : decoder.decode(data));
    if (message.kind === "robot") this.robots = new Map(this.robots).set(message.name, message);
  }

  /** Those in trouble first, then those that somebody has control of; each by its name. */
  get listed() {
    const rank = ({ trouble, starting, held }) => (trouble ? 0 : starting ? 1 : held ? 2 : 3);
    const order = new Intl.Collator("en", { numeric: true });
    return [...this.robots.values()].sort((a, b) => rank(a) - rank(b) || order.compare(a.name, b.name));
  }

  /** Let a token count from now on. */
  unlock(token) {
    sessionStorage.setItem("token", token);
    this.link = "connecting";
    this.board.connect();
    this.view?.connect();
  }
}

/** How a robot is: tone, symbol and words. */
function state({ trouble, starting, held, doing, rests }) {
  if (trouble) return ["bad", "error", trouble];
  if (starting) return ["warn", "hourglass_top", "Starting"];
  return [held ? "good" : "calm", rests ? "pause" : "play_arrow", `${doing}${rests ? "" : ", moving"}`];
}

function Row({ fleet, robot }) {
  const [tone, icon, text] = state(robot);
  const point = (name) => () => (fleet.pointed = name);
  return html`<li data-tone=${tone} data-pointed=${fleet.pointed === robot.name ? "" : undefined}
      onPointerEnter=${point(robot.name)} onPointerLeave=${point("")}>
    <a href=${robot.page} onFocus=${point(robot.name)} onBlur=${point("")}>
      <b>${robot.name}</b><span class="model">${robot.model === robot.name ? "" : robot.model}</span>
      <span class="state"><${Icon} name=${icon} />${text}</span></a></li>`;
}

function Summary({ fleet }) {
  const { link, robots } = fleet;
  const all = [...robots.values()];
  const count = (test) => all.filter(test).length;
  const trouble = count(({ trouble }) => trouble);
  const parts = [`${all.length} robots`, `${count(({ held }) => held)} in somebody's control`];
  const starting = count((robot) => robot.starting);
  if (starting) parts.push(`${starting} starting`);
  const lost = { connecting: "Connecting…", lost: "No connection; trying again…", token: "Locked" }[link];
  return html`<header>
    <h1>Fleet</h1><p>${parts.join(" · ")}</p>
    <${Pill} id="trouble" tone=${lost ? "warn" : trouble ? "bad" : "good"} icon=${lost || trouble ? "error" : "check_circle"}>
      ${lost ?? (trouble ? `${trouble} in trouble` : "All well")}</${Pill}>
    <${Theme} /></header>`;
}

/** The picture, with the robots' names where they stand. */
function View({ fleet }) {
  const pane = useRef(null);
  const names = useRef(null);
  useEffect(() => {
    let scene = null;
    try {
      scene = new window.VrsScene(pane.current, document.createElement("div"), () => label(scene, fleet, names.current));
    } catch {
      fleet.flat = true;
      return;
    }
    fleet.scene = scene;
    fleet.view = fleet.opened("/fleet/scene", ["vrs.meshcat.1"], (data) => scene.take(data), () => {});
    fleet.view.connect();
  }, []);
  return html`<div class="view"><div class="pane" ref=${pane} role="img" aria-label="All robots in 3D" hidden=${fleet.flat}></div>
    <div class="names" ref=${names} aria-hidden="true"></div>
    ${fleet.flat && html`<p class="no-3d">No 3D view: this browser offers no WebGL.</p>`}
    ${!fleet.flat && html`<button type="button" id="home" onClick=${() => fleet.scene.home()}>Reset view</button>`}</div>`;
}

/** Write the names; those of robots in trouble and of the one that is pointed at before others that they'd cover. */
function label(scene, fleet, names) {
  const taken = [];
  const first = fleet.robots.get(fleet.pointed);
  let used = 0;
  for (const robot of first ? [first, ...fleet.listed] : fleet.listed) {
    const body = scene.node("beside", robot.name, "virtual", "body", "0");
    const at = body.getWorldPosition(new window.MeshCat.THREE.Vector3()).project(scene.viewer.camera);
    const [x, y] = [((at.x + 1) / 2) * scene.width, ((1 - at.y) / 2) * scene.height];
    const wide = 8 * robot.name.length + 14;
    const hidden = at.z > 1 || Math.abs(at.x) > 1 || Math.abs(at.y) > 1;
    if (hidden || taken.some(([u, v, w]) => Math.abs(u - x) < (w + wide) / 2 && Math.abs(v - y) < 20)) continue;
    taken.push([x, y, wide]);
    const tag = names.children[used] ?? names.appendChild(document.createElement("span"));
    used += 1;
    window.VrsScene.write(tag, robot.name);
    tag.dataset.tone = state(robot)[0];
    tag.hidden = false;
    tag.style.transform = `translate(${Math.round(x)}px, ${Math.round(y - 26)}px) translateX(-50%)`;
  }
  for (const tag of [...names.children].slice(used)) tag.hidden = true;
}

function Page({ fleet }) {
  return html`<${Summary} fleet=${fleet} />
    <main><${View} fleet=${fleet} />
      <ol id="robots" aria-label="Robots">${fleet.listed.map((robot) => html`<${Row} key=${robot.name} fleet=${fleet} robot=${robot} />`)}</ol></main>
    ${fleet.link === "token" && html`<${Door} page=${fleet} />`}`;
}

const fleet = new Fleet();
fleet.board.connect();
render(html`<${Page} fleet=${fleet} />`, document.body);
window.fleet = fleet;
