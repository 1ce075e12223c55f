// Uses the page as a reader would, and writes down what happened. It runs after the page's own script.
(async () => {
  const result = { plots: [], stills: [], runs: [] };
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  const drawn = (svg) => [...svg.querySelectorAll('.curve')].map((path) => path.getAttribute('d'));
  try {
    await wait(200);
    for (const svg of document.querySelectorAll('figure svg:not(.mechanism)')) {
      if (!svg.getBoundingClientRect().width) continue; // In what is folded.
      const marks = svg.querySelectorAll('.curve, .heat, .dot');
      const longest = Math.max(0, ...[...marks].map((m) => (m.getAttribute('d') || 'circle').length));
      const box = svg.getBBox();
      result.stills.push({ marks: marks.length, longest, width: box.width, height: box.height });
    }
    for (const run of document.querySelectorAll('[data-curves]')) {
      run.open = true;
      await wait(200);
      const svg = run.querySelector('figure.plot svg');
      svg.scrollIntoView();
      await wait(600);
      // While a page scrolls, a wheel zooms only what was picked; the event of the scrolling above may come at any time.
      svg.focus({ preventScroll: true });
      const box = svg.getBoundingClientRect();
      const at = { clientX: box.left + box.width * 0.5, clientY: box.top + box.height * 0.5, bubbles: true, cancelable: true };
      const span = () => Number(run.dataset.to) - Number(run.dataset.from);
      const whole = span(), first = drawn(svg);
      const one = { whole, curves: first.length, shortest: Math.min(...first.map((d) => d.length)) };
      const step = async (name, act) => {
        const before = JSON.stringify(drawn(svg));
        act();
        await wait(200);
        one[name] = { span: span(), from: Number(run.dataset.from), changed: JSON.stringify(drawn(svg)) !== before };
      };
      await step('wheel', () => svg.dispatchEvent(new WheelEvent('wheel', { ...at, deltaY: -240 })));
      await step('drag', () => {
        const pointer = (type, by) => svg.dispatchEvent(new PointerEvent(type, { ...at, clientX: at.clientX + by, pointerId: 1, button: 0 }));
        pointer('pointerdown', 0); pointer('pointermove', 60); pointer('pointerup', 60);
      });
      one.readout = run.querySelector('.readout').textContent;
      await step('reset', () => svg.dispatchEvent(new MouseEvent('dblclick', at)));
      one.same = JSON.stringify(drawn(svg)) === JSON.stringify(first);
      await step('key', () => svg.dispatchEvent(new KeyboardEvent('keydown', { key: '+', bubbles: true, cancelable: true })));
      await step('zero', () => svg.dispatchEvent(new KeyboardEvent('keydown', { key: '0', bubbles: true, cancelable: true })));
      await step('mark', () => {
        const pointer = (type, by) => svg.dispatchEvent(new PointerEvent(type, { ...at, clientX: at.clientX + by, pointerId: 2, button: 0, shiftKey: true }));
        pointer('pointerdown', 0); pointer('pointermove', 80); pointer('pointerup', 80);
      });
      await step('button', () => run.querySelector('.tools button:last-child').click());
      await step('hidden', () => run.querySelector('button.key').click());
      one.left = drawn(svg).length;
      result.runs.push(one);
    }
    const table = document.querySelector('table.sortable');
    const head = table.querySelector('th.number');
    const column = [...head.parentNode.children].indexOf(head);
    const values = () => [...table.tBodies[0].rows].map((row) => Number(row.cells[column].dataset.value));
    head.querySelector('button').click();
    result.falling = values();
    head.querySelector('button').click();
    result.rising = values();
    result.wide = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  } catch (error) {
    window.heard.push(`exercise: ${error.stack}`);
  }
  result.heard = window.heard;
  const out = document.createElement('pre');
  out.id = 'result';
  out.textContent = JSON.stringify(result);
  document.body.append(out);
})();
