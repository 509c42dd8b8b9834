// Pointer, wheel, touch and keys over the picture: orbit, pan, zoom, fly; and clicks, which select.

const CLICK = 5; // pixels that a pointer may move and still click
const ORBIT = 0.008; // radians a pixel
const KEY_TURN = 0.06; // radians a press
const FLIGHT = {
  KeyW: [0, 0, 1], KeyS: [0, 0, -1], KeyA: [-1, 0, 0], KeyD: [1, 0, 0], KeyE: [0, 1, 0], KeyQ: [0, -1, 0],
};
const TURNS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/**
 * Let `canvas` move the camera of `view`. `grab(x, y, event)` may return {drag, drop} to have a press for
 * itself; `click(x, y)` and `hover(x, y)` are told places in the frame; `extent()` is the scene's size in metres.
 */
export function control(canvas, view, { grab, click, hover, extent }) {
  const pointers = new Map();
  let press = null;
  const flying = new Set();

  const touch = () => {
    const [a, b] = [...pointers.values()];
    return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, spread: Math.hypot(a.x - b.x, a.y - b.y) };
  };

  canvas.addEventListener("pointerdown", (event) => {
    if (!view.camera) return;
    canvas.focus({ preventScroll: true });
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (pointers.size === 2) {
      press?.handle?.drop();
      press = { touch: touch(), moved: Infinity };
      return;
    }
    const isPan = event.button === 1 || event.button === 2 || event.shiftKey;
    const handle = isPan ? null : grab(...view.place(event), event);
    press = { x: event.clientX, y: event.clientY, moved: 0, isPan, handle, button: event.button };
  });

  canvas.addEventListener("pointermove", (event) => {
    const pointer = pointers.get(event.pointerId);
    if (!pointer || !press) {
      if (view.shownCamera) hover(...view.place(event));
      return;
    }
    const [dx, dy] = [event.clientX - pointer.x, event.clientY - pointer.y];
    Object.assign(pointer, { x: event.clientX, y: event.clientY });
    press.moved += Math.hypot(dx, dy);
    if (pointers.size === 2) pinch();
    else if (press.handle) press.handle.drag(...view.place(event));
    else if (press.moved > CLICK) {
      if (press.isPan) view.camera.pan(dx, dy);
      else view.camera.orbit(dx * ORBIT, dy * ORBIT);
      view.changed();
    }
  });

  function pinch() {
    const now = touch();
    view.camera.pan(now.x - press.touch.x, now.y - press.touch.y);
    view.camera.zoom(press.touch.spread / Math.max(now.spread, 1));
    press.touch = now;
    view.changed();
  }

  const release = (event) => {
    if (!pointers.delete(event.pointerId) || !press) return;
    if (pointers.size > 0) return;
    const { handle, moved, button } = press;
    press = null;
    if (handle) handle.drop();
    else if (moved <= CLICK && button === 0 && event.type === "pointerup") click(...view.place(event));
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    if (!view.camera) return;
    event.preventDefault();
    view.camera.zoom(Math.exp(Math.max(-1, Math.min(1, event.deltaY * 0.0015))));
    view.changed();
  }, { passive: false });

  let last = 0;
  function flight(now) {
    if (flying.size === 0) return;
    const seconds = Math.min(0.1, (now - last) / 1000);
    last = now;
    const step = 0.4 * extent() * seconds;
    for (const code of flying) view.camera.fly(...FLIGHT[code].map((part) => part * step));
    view.changed();
    requestAnimationFrame(flight);
  }

  canvas.addEventListener("keydown", (event) => {
    if (!view.camera || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.code in FLIGHT) {
      if (flying.size === 0) {
        last = performance.now();
        requestAnimationFrame(flight);
      }
      flying.add(event.code);
    } else if (event.code in TURNS) {
      const [around, over] = TURNS[event.code].map((part) => part * KEY_TURN);
      if (event.shiftKey) view.camera.look(around, -over);
      else view.camera.orbit(-around, -over);
      view.changed();
    } else if (event.key === "+" || event.key === "=" || event.key === "-") {
      view.camera.zoom(event.key === "-" ? 1.1 : 1 / 1.1);
      view.changed();
    } else return;
    event.preventDefault();
  });
  canvas.addEventListener("keyup", (event) => flying.delete(event.code));
  canvas.addEventListener("blur", () => flying.clear());
}
