// Completions at the caret: keys and values of the schema of model files, kinds of effects, and names of the text itself.
// The list opens while the user types or with Ctrl+Space; arrows choose, Enter or Tab inserts, Escape closes.
(() => {
  'use strict';
  const { ask } = window.mill;
  const by = (id) => document.getElementById(id);
  const text = by('text'), list = by('offers');
  const MOST = 60;
  let schema = null, kinds = [], offers = [], chosen = 0, place = null;

  const fetched = async () => {
    const told = await ask('words', {});
    schema = told.schema;
    kinds = told.kinds;
  };

  // ---- where the caret is

  const HEAD = /^\s*(\[\[?)\s*([A-Za-z0-9_.\s]+?)\s*\]\]?\s*(#.*)?$/;
  // The table that contains a line: its path, and its lines.
  const tableOf = (lines, at) => {
    let from = at;
    while (from >= 0 && !HEAD.test(lines[from])) from--;
    let to = at + 1;
    while (to < lines.length && !HEAD.test(lines[to])) to++;
    const path = from >= 0 ? HEAD.exec(lines[from])[2].split('.').map((one) => one.trim()) : [];
    return { path, lines: lines.slice(from + 1, to) };
  };
  // The part of a line before the caret: keys that lead there, the unfinished word, whether a value is expected.
  const before = (words) => {
    const path = [];
    let key = '', isValue = false, quote = '', start = 0, depth = 0;
    for (let i = 0; i < words.length; i++) {
      const c = words[i];
      if (quote) {
        if (c === quote) { quote = ''; start = i + 1; }
        continue;
      }
      if (c === '#') return null;
      if (c === '"' || c === "'") { quote = c; start = i + 1; }
      else if (c === '=') { isValue = true; key = words.slice(start, i).trim(); start = i + 1; }
      else if (c === '{') { path.push(key); key = ''; isValue = false; start = i + 1; }
      else if (c === '}') { key = path.pop() || ''; isValue = true; start = i + 1; }
      else if (c === '[' && isValue) { depth++; start = i + 1; }
      else if (c === ']') { depth--; start = i + 1; }
      else if (c === ',') { if (!depth) { isValue = false; key = ''; } start = i + 1; }
      else if (/[\s*/+\-^()]/.test(c) && (isValue || start === i)) start = i + 1;
    }
    // Within quotes an expression consists of several words.
    if (quote) {
      const inner = words.slice(start);
      start += inner.length - /[A-Za-z0-9_]*$/.exec(inner)[0].length;
    }
    return { path, key: isValue ? key : '', isValue, quote, start, word: words.slice(start) };
  };

  // ---- definitions of the schema

  const resolved = (one) => {
    for (let steps = 0; one && one.$ref && steps < 9; steps++) one = { ...schema.$defs[one.$ref.split('/').pop()], ...(one.description ? { description: one.description } : {}) };
    const many = one && (one.anyOf || one.oneOf);
    if (many && !one.properties) {
      const best = many.map(resolved).find((other) => other && (other.properties || other.enum || other.type === 'array')) || resolved(many[0]);
      return { ...best, description: one.description || best.description };
    }
    return one;
  };
  const within = (one, name) => {
    one = resolved(one);
    if (one && one.type === 'array') one = resolved(one.items);
    if (!one) return null;
    if (one.properties && one.properties[name]) return resolved(one.properties[name]);
    return one.additionalProperties && typeof one.additionalProperties === 'object' ? resolved(one.additionalProperties) : null;
  };
  const properties = (one) => {
    one = resolved(one);
    if (one && one.type === 'array') one = resolved(one.items);
    return (one && one.properties) || {};
  };

  // ---- names that the text defines

  const named = () => {
    const names = { frame: ['base'], point: [], part: [], lumped_mass: [], drive: [], loop: [], coordinates: [], constants: [], parameters: [] };
    let table = '';
    for (const line of text.value.split('\n')) {
      const head = HEAD.exec(line);
      if (head) { table = head[2]; continue; }
      const own = /^\s*name\s*=\s*"([^"]+)"/.exec(line);
      if (own && names[table]) names[table].push(own[1]);
      const key = /^\s*([A-Za-z][A-Za-z0-9_]*)\s*=/.exec(line);
      if (key && ['coordinates', 'constants', 'parameters'].includes(table)) names[table].push(key[1]);
    }
    return names;
  };
  const plain = (names, says) => names.map((name) => ({ name, says }));
  const quantities = (names) => [...plain(names.coordinates, 'coordinate'), ...plain(names.constants, 'constant'), ...plain(names.parameters, 'parameter')];
  const POINTS = ['joins', 'from', 'to', 'force_at', 'moment_at'];

  // The kind that the table of the caret names.
  const kindOf = (lines) => {
    const found = lines.map((line) => /^\s*kind\s*=\s*"([^"]*)"/.exec(line)).find(Boolean);
    return found && kinds.find((kind) => kind.name === found[1]);
  };
  const places = (kind, names) => {
    const of = { drive: names.drive, force: names.drive, coordinate: names.coordinates, point: names.point, part: names.part, base: ['base'] };
    const on = kind ? kind.on : Object.keys(of);
    const all = on.flatMap((one) => plain(of[one] || [], one === 'force' ? 'drive' : one));
    return all.filter((one, k) => all.findIndex((other) => other.name === one.name) === k);
  };

  // Names that are possible for a value; `null` if only the schema determines them.
  const values = (table, path, key, lines) => {
    const names = named();
    const where = [...table, ...path];
    if (key === 'on') return plain(names.frame, 'frame');
    if (POINTS.includes(key)) return plain(names.point, 'point');
    if (where[0] === 'lumped_mass' && key === 'at') return [...plain(names.point, 'point'), ...quantities(names)];
    if (where[0] === 'drive' && key === 'joint') return plain(names.coordinates, 'coordinate');
    if (where[0] === 'frame' && where.includes('joint')) return plain(names.coordinates, 'coordinate');
    if (where[0] === 'effect' && key === 'kind') return kinds.map((kind) => ({ name: kind.name, says: kind.says }));
    if (where[0] === 'effect' && key === 'at') return places(kindOf(lines), names);
    return null;
  };
  const keys = (table, path, lines) => {
    const names = named();
    const where = [...table, ...path];
    const kind = kindOf(lines);
    if (where[0] === 'limits' && where.length === 2) return plain({ coordinates: names.coordinates, drives: names.drive, points: names.point }[where[1]] || [], where[1]);
    if (where[0] === 'effect' && where.length === 2 && kind) {
      if (where[1] === 'parameters') return kind.parameters.map((one) => ({ name: one.symbol, says: one.note || '' }));
      if (where[1] === 'constants') return kind.constants.map((one) => ({ name: one.symbol || one.name, says: one.note || '' }));
    }
    return null;
  };

  // All completions at the caret, with the range of the text that they replace.
  const wanted = () => {
    const caret = text.selectionStart;
    if (caret !== text.selectionEnd || !schema) return null;
    const lines = text.value.split('\n');
    const above = text.value.slice(0, caret).split('\n');
    const line = above[above.length - 1];
    const row = above.length - 1;
    const head = /^\s*\[\[?\s*([A-Za-z0-9_.]*)$/.exec(line);
    if (head) {
      const start = caret - line.trimStart().length;
      const all = Object.entries(schema.properties).map(([name, one]) => [name, resolved(one), one]);
      const heads = all.filter(([, one]) => one && (one.type === 'object' || (one.type === 'array' && properties(one).name)));
      return {
        start, word: head[1],
        all: heads.map(([name, one, own]) => ({ name, says: own.description || one.description || '', put: one.type === 'array' ? `[[${name}]]` : `[${name}]` })),
        // A closing bracket that is already there is replaced.
        end: caret + (/^\]{0,2}/.exec(text.value.slice(caret))[0].length),
      };
    }
    const at = before(line);
    if (!at) return null;
    const table = tableOf(lines, row);
    // All fields of a variant are optional.
    let one = { properties: schema.properties };
    for (const name of [...table.path, ...at.path]) one = one && within(one, name);
    const start = caret - line.length + at.start;
    const rest = { start, word: at.word, end: caret };
    if (!at.isValue) {
      const special = keys(table.path, at.path, table.lines);
      const here = properties(one);
      const there = at.path.length ? line.slice(line.lastIndexOf('{')) : table.lines.join('\n');
      const isThere = (name) => new RegExp(`(^|[\\n{,])\\s*${name}\\s*=`).test(there);
      // Tables at the top level of the file begin with a bracket, so they are not offered as keys.
      const isTable = (of) => !table.path.length && !at.path.length && (properties(of).name || (resolved(of) || {}).type === 'object');
      const all = special || Object.entries(here).filter(([, of]) => !isTable(of)).map(([name, of]) => ({ name, says: (resolved(of) || {}).description || '' }));
      return { ...rest, all: all.filter((offer) => offer.name === at.word || !isThere(offer.name)).map((offer) => ({ ...offer, put: `${offer.name} = ` })) };
    }
    const of = within(one, at.key) || {};
    let all = values(table.path, at.path, at.key, table.lines);
    const item = of.type === 'array' ? resolved(of.items) || {} : of;
    if (!all && item.enum) all = plain(item.enum.filter((v) => typeof v === 'string'), '');
    if (!all && item.type === 'boolean') return { ...rest, all: [{ name: 'true', says: '', put: 'true' }, { name: 'false', says: '', put: 'false' }] };
    if (!all && item.examples) all = plain(item.examples, '');
    if (!all && Array.isArray(item.type) && item.type.includes('string')) all = quantities(named());
    if (!all) return null;
    return { ...rest, all: all.map((offer) => ({ ...offer, put: at.quote ? offer.name : `"${offer.name}"` })) };
  };

  // ---- the list

  // Position of a character on the screen, px.
  const spot = (index) => {
    const style = getComputedStyle(text);
    const pen = spot.pen = spot.pen || document.createElement('canvas').getContext('2d');
    pen.font = `${style.fontSize} ${style.fontFamily}`;
    const lines = text.value.slice(0, index).split('\n');
    const line = lines[lines.length - 1].replace(/\t/g, '    ');
    const height = parseFloat(style.lineHeight);
    const box = text.getBoundingClientRect();
    return {
      x: box.left + parseFloat(style.paddingLeft) + pen.measureText(line).width - text.scrollLeft,
      y: box.top + parseFloat(style.paddingTop) + lines.length * height - text.scrollTop,
      height,
    };
  };
  const close = () => {
    offers = [];
    list.hidden = true;
    text.setAttribute('aria-expanded', 'false');
    text.removeAttribute('aria-activedescendant');
  };
  const mark = (k) => {
    chosen = (k + offers.length) % offers.length;
    [...list.children].forEach((one, i) => one.setAttribute('aria-selected', String(i === chosen)));
    const one = list.children[chosen];
    text.setAttribute('aria-activedescendant', one.id);
    one.scrollIntoView({ block: 'nearest' });
  };
  const open = () => {
    place = wanted();
    if (!place) { close(); return; }
    const begun = place.word.toLowerCase();
    const begins = (offer) => offer.name.toLowerCase().startsWith(begun);
    const holds = (offer) => begun.length > 1 && offer.name.toLowerCase().includes(begun);
    offers = [...place.all.filter(begins), ...place.all.filter((offer) => !begins(offer) && holds(offer))].slice(0, MOST);
    if (!offers.length || (offers.length === 1 && offers[0].name === place.word)) { close(); return; }
    list.replaceChildren(...offers.map((offer, k) => {
      const item = document.createElement('li');
      item.id = `offer${k}`;
      item.setAttribute('role', 'option');
      item.append(Object.assign(document.createElement('b'), { textContent: offer.name }));
      if (offer.says) item.append(Object.assign(document.createElement('span'), { textContent: offer.says }));
      item.addEventListener('pointerdown', (event) => { event.preventDefault(); mark(k); take(); });
      return item;
    }));
    list.hidden = false;
    text.setAttribute('aria-expanded', 'true');
    settle();
    mark(0);
  };
  // Places the list below its word, or above it if there is no room.
  const settle = () => {
    const { x, y, height } = spot(place.start);
    const box = list.getBoundingClientRect();
    list.style.left = `${Math.max(4, Math.min(x, innerWidth - box.width - 4))}px`;
    list.style.top = `${y + box.height + 4 > innerHeight ? Math.max(4, y - height - box.height) : y}px`;
  };
  const take = () => {
    const offer = offers[chosen];
    text.setSelectionRange(place.start, place.end);
    close();
    document.execCommand('insertText', false, offer.put);
  };

  text.addEventListener('keydown', (event) => {
    if ((event.ctrlKey || event.metaKey) && (event.key === ' ' || event.code === 'Space')) {
      event.preventDefault();
      fetched().then(open, () => {});
      return;
    }
    if (list.hidden) return;
    const act = {
      ArrowDown: () => mark(chosen + 1), ArrowUp: () => mark(chosen - 1),
      Enter: take, Tab: take, Escape: close,
    }[event.key];
    if (act) { event.preventDefault(); act(); }
    else if (['ArrowLeft', 'ArrowRight', 'Home', 'End', 'PageUp', 'PageDown'].includes(event.key)) close();
  });
  text.addEventListener('input', (event) => {
    const isWord = event.inputType === 'insertText' && event.data && event.data.length === 1 && /[A-Za-z_"]/.test(event.data);
    const isShorter = event.inputType === 'deleteContentBackward' && !list.hidden;
    if (!isWord && !isShorter) { if (!list.hidden) close(); return; }
    open();
    // After one letter there are too many completions; after a quote the possible names are shown at once.
    if (isWord && event.data !== '"' && place && !place.word.slice(1)) close();
  });
  text.addEventListener('blur', close);
  text.addEventListener('scroll', () => { if (!list.hidden) settle(); });
  text.addEventListener('pointerdown', close);
  const start = () => fetched().catch(() => setTimeout(start, 2000));
  start();
})();
