// Unfolds all folded parts for printing, for browsers in which the style sheet cannot do it.
(() => {
  'use strict';
  const unfold = () => {
    for (const one of document.querySelectorAll('details:not([open])')) { one.open = true; one.dataset.folded = ''; }
  };
  const fold = () => {
    for (const one of document.querySelectorAll('details[data-folded]')) { one.open = false; delete one.dataset.folded; }
  };
  window.addEventListener('beforeprint', unfold);
  window.addEventListener('afterprint', fold);
  window.matchMedia('print').addEventListener('change', (event) => (event.matches ? unfold : fold)());
})();
