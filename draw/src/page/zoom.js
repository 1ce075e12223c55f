// Zooms all pictures of a page in the same way. Wheel, pinch, keys and three buttons zoom; dragging moves the picture; dragging
// with Shift marks the part to show; a double click shows the complete picture. Places are shares of the picture, from 0 to 1,
// from its upper left corner.
(() => {
  'use strict';
  document.documentElement.classList.add('scripted');
  let scrolled = -1e9;
  window.addEventListener('scroll', () => { scrolled = performance.now(); }, { passive: true });

  // Adds the buttons of a picture at the beginning of `place`.
  const buttons = (place, shown) => {
    const tools = document.createElement('span');
    tools.className = 'tools';
    const button = (text, says, act) => {
      const one = document.createElement('button');
      one.type = 'button';
      one.textContent = text;
      one.title = says;
      one.setAttribute('aria-label', says);
      one.addEventListener('click', act);
      tools.appendChild(one);
    };
    button('+', 'zoom in', () => shown.zoom(0.5, 0.5, 0.5));
    button('\u2212', 'zoom out', () => shown.zoom(2, 0.5, 0.5));
    button('\u27F2', 'show all', () => shown.whole());
    place.prepend(tools);
  };

  // Makes the content of `element` zoomable through the methods of `shown`:
  // - `zoom(factor, x, y)` shows `factor` times as much around a place.
  // - `move(dx, dy)` moves by shares of the visible part.
  // - `whole()` shows everything; `isWhole()` returns whether everything is visible.
  // - `part(x0, y0, x1, y1)` shows the marked part; `marking(x0, y0, x1, y1)` draws the mark while it is drawn by the pointer.
  // - `turn(dx, dy)` (optional) replaces `move` for dragging and arrows. A key moves by `step`.
  window.zoomable = (element, shown, place) => {
    if (place) buttons(place, shown);
    if (!element.hasAttribute('tabindex')) element.setAttribute('tabindex', '0');
    const at = (event) => {
      const box = element.getBoundingClientRect();
      return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
    };
    element.addEventListener('wheel', (event) => {
      // Scrolling of the page continues if a picture comes under the pointer, or if the picture is shown completely.
      if (performance.now() - scrolled < 250 && document.activeElement !== element) return;
      if (event.deltaY > 0 && shown.isWhole() && !event.deltaX) return;
      event.preventDefault();
      if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) shown.move(event.deltaX / 600, 0);
      else shown.zoom(Math.pow(1.0018, Math.max(-240, Math.min(240, event.deltaY))), ...at(event));
    }, { passive: false });
    element.addEventListener('dblclick', (event) => { event.preventDefault(); shown.whole(); });

    const down = new Map();
    let mark = null, apart = 0;
    const reach = () => {
      const [a, b] = [...down.values()];
      return Math.max(Math.hypot(a[0] - b[0], a[1] - b[1]), 0.01);
    };
    element.addEventListener('pointerdown', (event) => {
      if (event.button > 0) return;
      try { element.setPointerCapture(event.pointerId); } catch { /* A simulated pointer cannot be captured. */ }
      down.set(event.pointerId, at(event));
      mark = event.shiftKey && shown.part && down.size === 1 ? at(event) : null;
      if (down.size === 2) apart = reach();
    });
    element.addEventListener('pointermove', (event) => {
      const before = down.get(event.pointerId);
      if (!before) return;
      const now = at(event);
      down.set(event.pointerId, now);
      if (down.size === 2) {
        const [a, b] = [...down.values()];
        const wide = reach();
        shown.zoom(apart / wide, (a[0] + b[0]) / 2, (a[1] + b[1]) / 2);
        apart = wide;
      } else if (mark) {
        if (shown.marking) shown.marking(...mark, ...now);
      } else (shown.turn || shown.move)(before[0] - now[0], before[1] - now[1]);
    });
    const up = (event) => {
      if (mark && event.type === 'pointerup') {
        const [x, y] = at(event);
        if (Math.abs(x - mark[0]) * element.getBoundingClientRect().width > 4)
          shown.part(Math.min(x, mark[0]), Math.min(y, mark[1]), Math.max(x, mark[0]), Math.max(y, mark[1]));
      }
      mark = null;
      if (shown.marking) shown.marking(0, 0, 0, 0);
      down.delete(event.pointerId);
    };
    element.addEventListener('pointerup', up);
    element.addEventListener('pointercancel', up);
    element.addEventListener('keydown', (event) => {
      const go = shown.turn || shown.move, step = shown.step || 0.2;
      const act = {
        '+': () => shown.zoom(0.5, 0.5, 0.5), '=': () => shown.zoom(0.5, 0.5, 0.5), '-': () => shown.zoom(2, 0.5, 0.5),
        ArrowLeft: () => go(-step, 0), ArrowRight: () => go(step, 0), ArrowUp: () => go(0, -step), ArrowDown: () => go(0, step),
        0: () => shown.whole(), Escape: () => shown.whole(), Home: () => shown.whole(),
      }[event.key];
      if (!act || event.ctrlKey || event.metaKey || event.target !== element) return;
      event.preventDefault();
      act();
    });
  };

  // The view of a static picture, through its viewBox. `svg()` returns the current picture; `again()` applies the same view
  // to a picture that replaced it.
  window.seen = (svg) => {
    let box = null;
    const all = () => {
      const one = svg();
      if (!one) return null;
      if (!one.dataset.whole) one.dataset.whole = one.getAttribute('viewBox');
      return one.dataset.whole.split(/[ ,]+/).map(Number);
    };
    const look = (wanted) => {
      const whole = all();
      if (!whole) return;
      const [left, top, width, height] = whole;
      const w = Math.min(Math.max(wanted[2], width / 400), width), h = w * height / width;
      const x = Math.min(Math.max(wanted[0], left), left + width - w), y = Math.min(Math.max(wanted[1], top), top + height - h);
      box = w >= width * 0.999 ? null : [x, y, w, h];
      svg().setAttribute('viewBox', (box || whole).map((v) => +v.toFixed(4)).join(' '));
    };
    const now = () => box || all() || [0, 0, 1, 1];
    return {
      zoom: (factor, x, y) => {
        const [left, top, w, h] = now();
        look([left + x * w * (1 - factor), top + y * h * (1 - factor), w * factor, h * factor]);
      },
      move: (dx, dy) => {
        const [left, top, w, h] = now();
        look([left + dx * w, top + dy * h, w, h]);
      },
      whole: () => look(all() || [0, 0, 1, 1]),
      isWhole: () => !box,
      part: (x0, y0, x1, y1) => {
        const [left, top, w, h] = now();
        const share = Math.max(x1 - x0, y1 - y0);
        look([left + w * (x0 + x1 - share) / 2, top + h * (y0 + y1 - share) / 2, w * share, h * share]);
      },
      again: () => { if (box) look(box); },
    };
  };

  // Makes the static pictures of a part of the page zoomable.
  window.enlivenPictures = (part) => {
    for (const svg of part.querySelectorAll('figure:not(.plot) svg')) {
      if ('zooms' in svg.dataset || !svg.getAttribute('viewBox')) continue;
      svg.dataset.zooms = '';
      const figure = svg.closest('figure');
      window.zoomable(svg, window.seen(() => svg), figure.querySelector('figcaption') || figure);
    }
  };
  window.enlivenPictures(document);
})();
