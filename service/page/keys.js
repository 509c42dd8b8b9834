// Keys of the whole page, the choice between handles, and files that are dropped.

const FIELDS = "input:not([type=checkbox], [type=radio], [type=color]), textarea";

/** Let keys do `deeds`: those of the picture while `picture` has the focus, the others everywhere. */
export function listen(deeds, picture, help) {
  const commands = { z: deeds.undo, y: deeds.redo };
  const anywhere = { "?": deeds.help, Escape: deeds.deselect };
  const there = {
    Delete: deeds.remove,
    Backspace: deeds.remove,
    f: deeds.focus,
    m: () => deeds.mode("move"),
    t: () => deeds.mode("turn"),
  };

  addEventListener("keydown", (event) => {
    if (event.target.matches(FIELDS) || help.open) return;
    const deed = event.ctrlKey || event.metaKey
      ? command(event)
      : anywhere[event.key] ?? (event.target === picture ? there[event.key] : undefined);
    if (!deed) return;
    event.preventDefault();
    deed();
  });

  function command({ key, shiftKey }) {
    return shiftKey && key.toLowerCase() === "z" ? deeds.redo : commands[key.toLowerCase()];
  }
}

/** Join the choice between moving and turning to `choose`; the function that is returned makes a choice. */
export function handleModes(choose) {
  const choices = [...document.querySelectorAll('input[name="mode"]')];
  for (const choice of choices) choice.addEventListener("change", () => choose(choice.value));
  return (mode) => {
    for (const choice of choices) choice.checked = choice.value === mode;
    choose(mode);
  };
}

/** Open files that are dropped on the page; `veil` covers it meanwhile. */
export function acceptFiles(veil, open) {
  addEventListener("dragover", (event) => {
    if (!event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault();
    veil.hidden = false;
  });
  addEventListener("dragleave", (event) => { if (!event.relatedTarget) veil.hidden = true; });
  addEventListener("drop", (event) => {
    veil.hidden = true;
    const [file] = event.dataTransfer?.files ?? [];
    if (!file) return;
    event.preventDefault();
    open(file);
  });
}
