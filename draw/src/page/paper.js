// Paper shows everything that is folded; browsers that cannot be told so by style are told here.
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
