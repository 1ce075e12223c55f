// What a reader cannot see or reach on a page as it is shown now: returned as sentences, none of them if all is well.
window.measure = (isPaper) => {
  const wrong = [];
  const root = document.scrollingElement;
  const width = root.clientWidth;
  const called = (one) => {
    const cls = typeof one.className === 'string' ? one.className : one.getAttribute('class') || '';
    const words = (one.textContent || '').trim().replace(/\s+/g, ' ').slice(0, 40);
    return `${one.localName}${one.id ? `#${one.id}` : ''}${cls ? `.${cls.trim().replace(/\s+/g, '.')}` : ''} "${words}"`;
  };
  if (root.scrollWidth > width) wrong.push(`the page is ${root.scrollWidth} wide, the window ${width}`);
  for (const one of document.body.querySelectorAll('*')) {
    if (!one.checkVisibility({ contentVisibilityAuto: true, visibilityProperty: true })) continue;
    // The text field of an editor moves under its caret; what stands inside pictures has no box of its own.
    if (one.closest('textarea, option, script, style') || one.closest('#editor')) continue;
    if (one.closest('svg') && one.localName !== 'svg') continue;
    if (one.closest('math') && one.localName !== 'math') continue;
    const style = getComputedStyle(one);
    const box = one.getBoundingClientRect();
    if (!box.width || !box.height) continue;
    if (box.right > width + 1 || box.left < -1) wrong.push(`${called(one)} reaches from ${box.left.toFixed(0)} to ${box.right.toFixed(0)} of ${width}`);
    const more = (way) => /auto|scroll|hidden|clip/.test(style[`overflow${way}`]);
    const [wide, high] = [one.scrollWidth - one.clientWidth, one.scrollHeight - one.clientHeight];
    if (one.localName !== 'svg' && style.display !== 'inline' && one !== root && one !== document.body) {
      if (more('X') && wide > 1) wrong.push(`${called(one)} hides ${wide} of its width`);
      // Panes of the workbench may be moved up and down on a screen; nothing may on paper.
      if (isPaper && more('Y') && high > 1) wrong.push(`${called(one)} hides ${high} of its height`);
    }
  }
  if (isPaper) {
    for (const one of document.querySelectorAll('details')) {
      const inner = one.lastElementChild;
      if (inner && inner.localName !== 'summary' && one.checkVisibility() && !inner.getBoundingClientRect().height && !inner.closest('script'))
        wrong.push(`${called(one)} is folded`);
    }
  }
  return wrong.slice(0, 30);
};

// Text whose contrast with what lies below it is less than WCAG 2.2 asks for (1.4.3: 4.5, or 3 where letters are large).
window.faint = () => {
  const canvas = document.createElement('canvas').getContext('2d', { willReadFrequently: true });
  const rgba = (colour) => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = '#000';
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const over = ([r, g, b, a], [x, y, z]) => [r * a + x * (1 - a), g * a + y * (1 - a), b * a + z * (1 - a), 1];
  // Relative luminance (WCAG 2.2).
  const light = (colour) => {
    const [r, g, b] = colour.map((v) => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ground = (one) => {
    const layers = [];
    for (let at = one; at; at = at.parentElement) {
      const sheet = at.localName === 'svg' && at.querySelector(':scope > rect.paper');
      if (sheet) { layers.push(rgba(getComputedStyle(sheet).fill)); break; }
      const colour = rgba(getComputedStyle(at).backgroundColor);
      if (colour[3] > 0) layers.push(colour);
      if (colour[3] === 1) break;
    }
    return layers.reverse().reduce((below, layer) => over(layer, below), rgba(getComputedStyle(document.body).backgroundColor));
  };
  const found = new Map();
  let counted = 0;
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const one = walk.currentNode.parentElement;
    if (!walk.currentNode.data.trim() || one.closest('script, style, title, option') || one.closest(':disabled')) continue;
    if (!one.checkVisibility({ contentVisibilityAuto: true, opacityProperty: true, visibilityProperty: true })) continue;
    const style = getComputedStyle(one);
    const isDrawn = Boolean(one.closest('svg'));
    const below = ground(one);
    const ink = rgba(isDrawn ? style.fill : style.color);
    let share = 1;
    for (let at = one; at; at = at.parentElement) share *= Number(getComputedStyle(at).opacity);
    ink[3] *= share;
    const [a, b] = [light(over(ink, below)), light(below)];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    const size = parseFloat(style.fontSize);
    const least = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700) ? 3 : 4.5;
    counted++;
    if (ratio < least) {
      const cls = one.getAttribute('class') || '';
      found.set(`${one.localName}.${cls}`, `${one.localName}.${cls} "${walk.currentNode.data.trim().slice(0, 30)}": ${ratio.toFixed(2)}`);
    }
  }
  return { counted, found: [...found.values()] };
};

// What can be used with a pointer and has no name, or cannot be reached by keys.
window.nameless = () => {
  const wrong = [];
  for (const one of document.querySelectorAll('button, input, select, textarea, a[href], summary, [role="img"], [tabindex="0"]')) {
    if (!one.checkVisibility()) continue;
    const label = one.labels && [...one.labels].map((l) => l.textContent).join('');
    const title = one.querySelector && one.querySelector(':scope > title');
    const name = one.getAttribute('aria-label') || label || one.textContent.trim() || one.title || (title && title.textContent);
    if (!name) wrong.push(`${one.outerHTML.slice(0, 80)} has no name`);
    if (one.matches('button, input, select, textarea, a[href], summary') && one.tabIndex < 0 && one.getAttribute('role') !== 'tab')
      wrong.push(`${one.outerHTML.slice(0, 80)} is not reached by keys`);
  }
  return wrong;
};
