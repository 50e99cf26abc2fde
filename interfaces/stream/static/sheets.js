// The pages' policy allows no <style> that a script makes. MeshCat's bundle and xterm.js make some: here they get an
// element whose rules are a sheet of the document's instead.
"use strict";

{
  const make = document.createElement.bind(document);

  function ruled() {
    const element = make("link");
    const sheet = new CSSStyleSheet();
    document.adoptedStyleSheets.push(sheet);
    const text = { set: (css) => sheet.replaceSync(css) };
    Object.defineProperties(element, { sheet: { value: sheet }, textContent: text, innerHTML: text });
    element.remove = () => {
      document.adoptedStyleSheets = document.adoptedStyleSheets.filter((one) => one !== sheet);
      Element.prototype.remove.call(element);
    };
    return element;
  }

  document.createElement = (name, ...more) => (name === "style" ? ruled() : make(name, ...more));
}
