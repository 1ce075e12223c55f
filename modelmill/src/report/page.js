// Redraws curves for the visible segment of time, and makes tables sortable. Without this script the pictures are static.
(() => {
  'use strict';
  const SVG = 'http://www.w3.org/2000/svg';
  const HEIGHT = 210, LEFT = 66, RIGHT = 14, TOP = 8, BOTTOM = 34;

  const make = (name, attributes, parent, text) => {
    const element = document.createElementNS(SVG, name);
    for (const key in attributes) element.setAttribute(key, attributes[key]);
    if (text !== undefined) element.textContent = text;
    parent.appendChild(element);
    return element;
  };

  // A curve's values: 16-bit steps between its least and its largest value; 65535 is a gap.
  const unpack = (curve) => {
    const bytes = atob(curve.data);
    const values = new Float64Array(bytes.length / 2);
    for (let i = 0; i < values.length; i++) {
      const steps = bytes.charCodeAt(2 * i) | bytes.charCodeAt(2 * i + 1) << 8;
      values[i] = steps === 65535 ? NaN : curve.low + curve.step * steps;
    }
    return { name: curve.name, cls: curve.class, from: curve.span[0], to: curve.span[1], values, shown: true };
  };

  const ticks = (from, to, most) => {
    const round = (rough) => {
      const decade = Math.pow(10, Math.floor(Math.log10(rough)));
      return [1, 2, 5, 10].find((s) => s * decade >= rough * 0.999) * decade;
    };
    let step = round(Math.max((to - from) / most, Number.MIN_VALUE * 1e10));
    // One value alone gives no scale.
    const within = (s) => Math.floor(to / s + 1e-9) - Math.ceil(from / s - 1e-9);
    for (let tries = 0; tries < 2; tries++) if (within(step) < 1 && most > 1) step = round(0.4 * step);
    const decimals = Math.min(12, Math.max(0, -Math.floor(Math.log10(step * 1.001))));
    const label = (v) => {
      if (Math.abs(v) < 1e-9 * step) return '0';
      if (Math.abs(v) >= 1e5 || step < 1e-4) return v.toExponential(1).replace('.0e', 'e').replace('e+', 'e');
      return v.toFixed(decimals).replace('-', '\u2212');
    };
    const found = [];
    for (let k = Math.ceil(from / step - 1e-9); k * step <= to + 1e-9 * step && found.length < 30; k++)
      found.push([k * step, label(k * step)]);
    return found;
  };

  // Indices of the values of a curve within a segment of time, with one more at each end.
  const within = (curve, from, to) => {
    const last = curve.values.length - 1;
    const at = (t) => (t - curve.from) / Math.max(curve.to - curve.from, Number.MIN_VALUE) * last;
    return [Math.max(0, Math.floor(at(from))), Math.min(last, Math.ceil(at(to)))];
  };

  class Run {
    constructor(root) {
      this.root = root;
      const data = JSON.parse(document.getElementById(root.dataset.curves).textContent);
      const figures = root.querySelectorAll('figure.plot');
      this.plots = data.panels.map((panel, k) => new Plot(this, figures[k], panel));
      const curves = this.plots.flatMap((plot) => plot.curves);
      this.whole = [Math.min(...curves.map((c) => c.from)), Math.max(...curves.map((c) => c.to))];
      this.show(...this.whole);
      root.addEventListener('toggle', () => this.draw());
    }

    // Shows a segment of time, limited to the recording and to a least length.
    show(from, to) {
      const [first, last] = this.whole;
      const least = (last - first) * 1e-4;
      const length = Math.min(Math.max(to - from, least), last - first);
      this.from = Math.min(Math.max(from, first), last - length);
      this.to = this.from + length;
      this.root.dataset.from = this.from;
      this.root.dataset.to = this.to;
      this.draw();
    }

    zoom(factor, at) {
      const middle = at === undefined ? (this.from + this.to) / 2 : at;
      this.show(middle - (middle - this.from) * factor, middle + (this.to - middle) * factor);
    }

    move(share) {
      const by = share * (this.to - this.from);
      this.show(this.from + by, this.to + by);
    }

    reset() { this.show(...this.whole); }

    draw() {
      if (this.waiting || !this.plots) return;
      this.waiting = true;
      // Many events are drawn once. The timer draws where frames are not requested, as in a hidden tab.
      const now = () => {
        if (!this.waiting) return;
        this.waiting = false;
        for (const plot of this.plots) plot.draw();
      };
      requestAnimationFrame(now);
      setTimeout(now, 60);
    }
  }

  class Plot {
    constructor(run, figure, panel) {
      this.run = run;
      this.svg = figure.querySelector('svg');
      this.curves = panel.curves.map(unpack);
      this.unit = panel.unit;
      this.legend(figure);
      this.readout = document.createElement('output');
      this.readout.className = 'readout';
      figure.appendChild(this.readout);
      this.listen(figure);
    }

    legend(figure) {
      for (const key of figure.querySelectorAll('.key')) {
        const curve = this.curves.find((c) => c.name === key.dataset.curve);
        const button = document.createElement('button');
        button.type = 'button';
        button.className = key.className;
        button.textContent = key.textContent;
        button.setAttribute('aria-pressed', 'true');
        button.addEventListener('click', () => {
          curve.shown = !curve.shown;
          button.setAttribute('aria-pressed', String(curve.shown));
          this.draw();
        });
        key.replaceWith(button);
      }
    }

    draw() {
      const box = this.svg.getBoundingClientRect();
      if (!box.width) return;
      const width = this.width = Math.max(280, box.width);
      const { from, to } = this.run;
      this.x = (t) => LEFT + (t - from) / (to - from) * (width - LEFT - RIGHT);
      let low = Infinity, high = -Infinity;
      for (const curve of this.curves) {
        if (!curve.shown) continue;
        const [first, last] = within(curve, from, to);
        for (let i = first; i <= last; i++) {
          const v = curve.values[i];
          if (v < low) low = v;
          if (v > high) high = v;
        }
      }
      if (!(high >= low)) { low = -1; high = 1; }
      const room = high > low ? 0.05 * (high - low) : 0.5 * Math.max(Math.abs(high), 1e-9);
      low -= room; high += room;
      const foot = HEIGHT - BOTTOM;
      const y = (v) => foot - (v - low) / (high - low) * (foot - TOP);
      this.svg.setAttribute('viewBox', `0 0 ${width} ${HEIGHT}`);
      this.svg.replaceChildren();
      for (const [v, label] of ticks(from, to, Math.max(3, Math.min(10, width / 85)))) {
        const at = this.x(v).toFixed(1);
        make('path', { class: 'grid', d: `M${at} ${TOP}V${foot}` }, this.svg);
        make('text', { class: 'tick', x: at, y: foot + 15, 'text-anchor': 'middle' }, this.svg, label);
      }
      for (const [v, label] of ticks(low, high, 4)) {
        const at = y(v).toFixed(1);
        make('path', { class: 'grid', d: `M${LEFT} ${at}H${width - RIGHT}` }, this.svg);
        make('text', { class: 'tick', x: LEFT - 6, y: +at + 4, 'text-anchor': 'end' }, this.svg, label);
      }
      make('text', { class: 'tick', x: width - RIGHT, y: foot + 31, 'text-anchor': 'end' }, this.svg, 'time, s');
      for (const curve of this.curves)
        if (curve.shown) make('path', { class: `curve ${curve.cls}`, d: this.path(curve, y) }, this.svg);
      make('path', { class: 'frame', d: `M${LEFT} ${TOP}H${width - RIGHT}V${foot}H${LEFT}Z` }, this.svg);
      this.marked = make('rect', { class: 'marked', x: 0, y: TOP, width: 0, height: foot - TOP }, this.svg);
      this.cursor = make('path', { class: 'cursor', d: '' }, this.svg);
    }

    // One point for a value, or least and largest of each pixel where there are more values than pixels.
    path(curve, y) {
      const [first, last] = within(curve, this.run.from, this.run.to);
      const { values, from, to } = curve;
      const end = Math.max(values.length - 1, 1);
      const edge = (v) => Math.min(Math.max(v, LEFT), this.width - RIGHT);
      const x = (i) => this.x(from + (to - from) * i / end);
      const stretch = Math.max(1, Math.floor((last - first + 1) / (2 * this.width)));
      let d = '', pen = 'M';
      const put = (i) => {
        const v = values[i];
        if (Number.isNaN(v)) { pen = 'M'; return; }
        d += `${pen}${edge(x(i)).toFixed(1)} ${y(v).toFixed(1)}`;
        pen = 'L';
      };
      for (let i = first; i <= last; i += stretch) {
        let low = i, high = i;
        for (let j = i; j < Math.min(i + stretch, last + 1); j++) {
          if (values[j] < values[low]) low = j;
          if (values[j] > values[high]) high = j;
        }
        put(Math.min(low, high));
        if (low !== high) put(Math.max(low, high));
      }
      return d;
    }

    time(event) {
      const box = this.svg.getBoundingClientRect();
      const inner = (this.width || box.width) - LEFT - RIGHT;
      const share = ((event.clientX - box.left) * (this.width || box.width) / box.width - LEFT) / inner;
      return this.run.from + Math.min(Math.max(share, 0), 1) * (this.run.to - this.run.from);
    }

    // Only time is zoomed; the scale of forces follows the visible values.
    listen(figure) {
      const { svg, run } = this;
      const share = (x) => this.time({ clientX: svg.getBoundingClientRect().left + x * svg.getBoundingClientRect().width });
      const shown = {
        zoom: (factor, x) => run.zoom(factor, x === 0.5 ? undefined : share(x)),
        move: (dx) => run.move(dx * (this.width || 1) / ((this.width || 1) - LEFT - RIGHT)),
        whole: () => run.reset(),
        isWhole: () => run.to - run.from >= (run.whole[1] - run.whole[0]) * (1 - 1e-9),
        part: (x0, y0, x1) => run.show(share(x0), share(x1)),
        marking: (x0, y0, x1) => {
          if (!this.marked) return;
          const [a, b] = [x0, x1].map((x) => this.x(share(x)));
          this.marked.setAttribute('x', Math.min(a, b));
          this.marked.setAttribute('width', Math.abs(a - b));
        },
      };
      window.zoomable(svg, shown, figure.querySelector('figcaption'));
      svg.addEventListener('pointermove', (event) => this.tell(event));
      svg.addEventListener('pointerleave', () => {
        this.readout.textContent = '';
        if (this.cursor) this.cursor.setAttribute('d', '');
      });
    }

    // Shows the values at the pointer.
    tell(event) {
      if (!this.x || !this.cursor) return;
      const t = this.time(event);
      const at = this.x(t).toFixed(1);
      this.cursor.setAttribute('d', `M${at} ${TOP}V${HEIGHT - BOTTOM}`);
      const digits = (v) => (Number.isFinite(v) ? Number(v.toPrecision(4)).toString() : '\u2014');
      const values = this.curves.filter((c) => c.shown).map((c) => {
        const i = Math.round((t - c.from) / Math.max(c.to - c.from, Number.MIN_VALUE) * (c.values.length - 1));
        return `${c.name} ${digits(c.values[Math.min(Math.max(i, 0), c.values.length - 1)])}`;
      });
      this.readout.textContent = `${t.toFixed(3)} s: ${values.join(', ')} ${this.unit}`;
    }
  }

  let runs = [];
  const again = () => runs.forEach((run) => run.draw());
  if (window.ResizeObserver) {
    const observer = new ResizeObserver(again);
    observer.observe(document.querySelector('main'));
  } else window.addEventListener('resize', again);

  // Folded parts get their width only when they are opened for printing.
  window.addEventListener('beforeprint', again);

  // Adds the script to the curves and tables of an element, and forgets those of removed elements.
  window.enliven = (part) => {
    runs = runs.filter((run) => run.root.isConnected);
    runs.push(...[...part.querySelectorAll('[data-curves]')].map((root) => new Run(root)));
    window.enlivenPictures(part);
    for (const table of part.querySelectorAll('table.sortable')) {
      const heads = [...table.querySelectorAll('th')];
      heads.forEach((head, k) => {
        const button = document.createElement('button');
        button.type = 'button';
        button.append(...head.childNodes);
        head.append(button);
        button.addEventListener('click', () => {
          const falling = head.classList.contains('number') ? head.ariaSort !== 'descending' : head.ariaSort === 'ascending';
          for (const other of heads) other.removeAttribute('aria-sort');
          head.setAttribute('aria-sort', falling ? 'descending' : 'ascending');
          const key = (row) => {
            const cell = row.cells[k];
            const value = cell.dataset.value;
            return value === undefined ? cell.textContent.trim() : Number(value);
          };
          const body = table.tBodies[0];
          const rows = [...body.rows].map((row) => [key(row), row]);
          rows.sort(([a], [b]) => {
            if (typeof a === 'number' && typeof b === 'number') return a - b;
            // Cells without a number come first in rising order, last in falling order.
            if (typeof a !== typeof b) return typeof a === 'string' ? -1 : 1;
            return a.localeCompare(b);
          });
          if (falling) rows.reverse();
          body.append(...rows.map(([, row]) => row));
        });
      });
    }
  };
  window.enliven(document);
})();
