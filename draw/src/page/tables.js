// Tables: each cell gets the name of its column, for narrow screens that show rows as cards. A click on a number copies all of
// its digits.
(() => {
  'use strict';
  const told = document.createElement('p');
  told.className = 'told';
  told.setAttribute('role', 'status');
  document.body.append(told);
  let fading = 0;
  const say = (words) => {
    told.textContent = words;
    clearTimeout(fading);
    fading = setTimeout(() => { told.textContent = ''; }, 2500);
  };

  // Copies a text to the clipboard. Browsers without the clipboard interface use a selection instead.
  window.copied = async (text, what) => {
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      const held = document.activeElement;
      const area = document.createElement('textarea');
      area.value = text;
      document.body.append(area);
      area.select();
      const isDone = document.execCommand('copy');
      area.remove();
      if (held) held.focus({ preventScroll: true });
      if (!isDone) { say('The browser does not allow this page to copy. Select the text and copy it by hand.'); return; }
    }
    say(`${what || text} is copied`);
  };

  const NUMBER = /^[-+\u2212]?\d[\d.]*(e[-+\u2212]?\d+)?( %)?$/;
  const isNumber = (cell) => cell.matches && cell.matches('tbody td') && (cell.dataset.value !== undefined || NUMBER.test(cell.textContent.trim()));
  const digits = (cell) => (cell.dataset.value === undefined ? cell.textContent.trim().replaceAll('\u2212', '-') : String(Number(cell.dataset.value)));
  const copy = (cell) => window.copied(digits(cell));
  document.addEventListener('click', (event) => {
    const cell = event.target.closest && event.target.closest('td');
    if (cell && isNumber(cell) && String(getSelection()) === '') copy(cell);
  });
  // Tab reaches one number of a table; arrows reach the others.
  document.addEventListener('keydown', (event) => {
    const cell = event.target;
    if (!isNumber(cell)) return;
    if (event.key === 'Enter' || event.key === ' ') {
      event.preventDefault();
      copy(cell);
      return;
    }
    const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
    if (!step) return;
    event.preventDefault();
    const rows = [...cell.closest('tbody').rows];
    let [row, column] = [rows.indexOf(cell.parentNode), cell.cellIndex];
    for (;;) {
      row += step[0];
      column += step[1];
      const next = rows[row] && rows[row].cells[column];
      if (!next) return;
      if (!isNumber(next)) continue;
      cell.tabIndex = -1;
      next.tabIndex = 0;
      next.focus();
      return;
    }
  });

  // Tables with at most this number of columns do not become cards.
  const WIDE = 3;
  window.enlivenTables = (part) => {
    const tables = part.matches && part.matches('table') ? [part] : part.querySelectorAll('table');
    for (const table of tables) {
      const heads = [...table.querySelectorAll('thead th')].map((head) => head.textContent.trim());
      table.classList.toggle('cards', heads.length > WIDE);
      let first = true;
      for (const body of table.tBodies) {
        for (const row of body.rows) {
          [...row.cells].forEach((cell, k) => {
            if (heads[k]) cell.dataset.head = heads[k];
            if (!isNumber(cell)) return;
            cell.tabIndex = first ? 0 : -1;
            cell.title = 'click to copy all digits';
            first = false;
          });
        }
      }
    }
  };
  window.enlivenTables(document);
})();
