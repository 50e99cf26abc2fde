// Who has control: shown always; asked for, given back and taken over by buttons.
import { draw, h, icon, mark, write } from "./dom.js";

export function mount(station, box) {
  const session = station.session;
  const symbol = icon("help");
  const words = h("span");
  const pill = h("span.pill", { id: "control-pill", role: "status" }, symbol, words);
  const take = button("take", "Take control", () => ask("acquire"));
  const give = button("give", "Give back", () => ask("release"));
  const over = button("take-over", "Take over", () => confirmTakeOver());
  const name = h("input", { id: "name", maxlength: 40, size: 14, "aria-label": "Your name, as others see it" });
  const me = h("details.me", {}, h("summary", { "aria-label": "Your name", title: "Your name" }, icon("person")), name);
  box.append(pill, take, give, over, me);
  let wanted = false;
  name.value = session.name;
  name.addEventListener("change", () => {
    const given = name.value.trim();
    if (given) station.rename(given);
    name.value = session.name;
    me.open = false;
    if (given) station.announce(`You are ${given} from your next connection on`);
  });

  function button(id, text, action) {
    return h("button.small", { type: "button", id, onclick: action, hidden: true }, text);
  }

  function ask(type) {
    wanted = type === "acquire";
    session.wish(type);
  }

  function confirmTakeOver() {
    const holder = session.lease.holder ?? "the one who has it";
    const dialog = h(
      "dialog.ask",
      { "aria-label": "Take over control" },
      h("p", {}, `Take control from ${holder}? The robot is stopped first.`),
      h(
        "div.row",
        {},
        h("button.main", { type: "button", id: "take-over-yes", onclick: () => ask("take-over") || dialog.close() },
          "Stop and take over"),
        h("button", { type: "button", onclick: () => dialog.close() }, "Leave it"),
      ),
    );
    dialog.addEventListener("close", () => dialog.remove());
    document.getElementById("station").append(dialog);
    dialog.showModal();
  }

  function show() {
    const { lease, welcome } = session;
    const live = session.link === "live";
    const role = welcome?.role;
    const [tone, name, text] = !live
      ? ["none", "help", "Control unknown"]
      : session.holds
        ? ["mine", "sports_esports", "You have control"]
        : lease.state === "held"
          ? ["other", "person", `${lease.holder} has control`]
          : lease.state === "ending"
            ? ["warn", "hourglass_top", "The robot comes to rest"]
            : ["none", "lock_open", role === "viewer" ? "You watch" : "Nobody has control"];
    mark(pill, "data-tone", tone);
    draw(symbol, name);
    write(words, text);
    take.hidden = !(live && session.mayCommand && lease.state === "free");
    give.hidden = !(live && session.holds);
    over.hidden = !(live && role === "admin" && lease.state === "held" && !session.holds);
    mark(document.getElementById("station"), "data-control", live && session.holds ? "yes" : "no");
  }

  station.on("lease", (lease) => {
    show();
    const why = { expired: "it ran out", released: "given back", "taken over": "it was taken over" }[lease.ended];
    if (session.holds) station.announce("You have control");
    else if (lease.state === "held") station.announce(`${lease.holder} has control`);
    else if (lease.state === "ending" && why) station.announce(`Control ended: ${why}`);
    // The robot was still coming to rest when it was asked for.
    if (session.holds || lease.state === "held") wanted = false;
    else if (wanted && lease.state === "free") ask("acquire");
  });
  for (const type of ["link", "welcome"]) station.on(type, show);
  show();
}
