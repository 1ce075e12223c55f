// Hears everything that goes wrong, before the page's own script runs.
window.heard = [];
window.addEventListener('error', (event) => window.heard.push(`error: ${event.message || event.target}`), true);
window.addEventListener('unhandledrejection', (event) => window.heard.push(`rejection: ${event.reason}`));
window.addEventListener('securitypolicyviolation', (event) => window.heard.push(`outside: ${event.blockedURI}`));
console.error = console.warn = (...words) => window.heard.push(`console: ${words.join(' ')}`);
