(page) => {
  const faults = [], view = page.defaultView, all = (selector) => [...page.querySelectorAll(selector)];
  const fault = (it, what) => faults.push(what + ": " + (it ? it.outerHTML.slice(0, 90) : ""));
  const isShown = (it) => it.getClientRects().length > 0 && view.getComputedStyle(it).visibility === "visible";
  const root = page.documentElement;
  if (!root.lang) fault(null, "no language");
  if (!page.title.trim()) fault(null, "no title");
  if (!page.querySelector("main")) fault(null, "no main");
  if (root.scrollWidth > view.innerWidth) {
    const widest = all("body *").find((it) => it.getBoundingClientRect().right > view.innerWidth + 1);
    fault(widest ?? root, "is wider than " + view.innerWidth);
  }

  // Contrast, WCAG 2.2 AA.
  const colour = (text) => {
    const [r, g, b, a = 1] = text.match(/[\d.]+/g).map(Number);
    return { rgb: [r, g, b], a };
  };
  const luminance = (rgb) => {
    const [r, g, b] = rgb.map((it) => it / 255).map((it) => (it <= 0.04045 ? it / 12.92 : ((it + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const over = (front, back) => front.rgb.map((it, i) => it * front.a + back[i] * (1 - front.a));
  const canvas = view.matchMedia("(prefers-color-scheme:dark)").matches ? [18, 18, 18] : [255, 255, 255];
  const ground = (it) => {
    if (!it) return canvas;
    const own = colour(view.getComputedStyle(it).backgroundColor);
    return own.a === 1 ? own.rgb : over(own, ground(it.parentElement));
  };
  let checked = 0;
  const walk = page.createTreeWalker(page.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const it = walk.currentNode.parentElement;
    if (!walk.currentNode.data.trim() || /^(SCRIPT|STYLE|OPTION)$/.test(it.tagName) || !isShown(it)) continue;
    const style = view.getComputedStyle(it), back = ground(it);
    const front = over(colour(it instanceof view.SVGElement ? style.fill : style.color), back);
    const [a, b] = [luminance(front), luminance(back)].sort((x, y) => y - x), ratio = (a + 0.05) / (b + 0.05);
    const size = parseFloat(style.fontSize), isLarge = size >= 24 || (size >= 18.66 && style.fontWeight >= 700);
    checked += 1;
    if (ratio < (isLarge ? 3 : 4.5)) fault(it, "contrast " + ratio.toFixed(2));
  }

  // Names for what is seen and used.
  const name = (it) => (it.getAttribute("aria-label") ?? it.textContent).trim() || [...it.querySelectorAll("img")].map((img) => img.alt).join("");
  for (const it of all("img")) if (!it.hasAttribute("alt")) fault(it, "img without a text");
  for (const it of all("[role=img]")) if (!name(it)) fault(it, it.tagName.toLowerCase() + " without a name");
  for (const it of all("svg:not([role=img])")) if (it.getAttribute("aria-hidden") !== "true") fault(it, "svg that is neither told nor hidden");
  for (const it of all("input,select,textarea")) if (!it.labels.length && !it.getAttribute("aria-label")) fault(it, it.tagName.toLowerCase() + " without a label");
  for (const it of all("a[href],button,summary,[role=region]")) if (!name(it)) fault(it, it.tagName.toLowerCase() + " without a name");
  for (const it of all("th")) if (!it.scope) fault(it, "th without a scope");

  // Order.
  let before = 0;
  for (const it of all("h1,h2,h3,h4")) {
    const level = Number(it.tagName[1]);
    if (level > before + 1) fault(it, "h" + level + " after h" + before);
    before = level;
  }
  if (all("h1").length !== 1) fault(null, all("h1").length + " h1");
  const ids = new Set();
  for (const it of all("[id]")) {
    if (ids.has(it.id)) fault(it, "id " + it.id + " twice");
    ids.add(it.id);
  }

  // Keyboard.
  for (const it of all("[tabindex]")) if (it.tabIndex > 0) fault(it, "tabindex");
  for (const it of all("body *")) {
    const style = view.getComputedStyle(it), scrolls = /auto|scroll/.test(style.overflowX + style.overflowY);
    const isLonger = it.scrollWidth > it.clientWidth + 1 || it.scrollHeight > it.clientHeight + 1;
    if (scrolls && isLonger && it.tabIndex < 0) fault(it, "out of reach of the keyboard");
  }
  for (const it of all("[onclick],[role=button]")) if (it.tabIndex < 0) fault(it, "out of reach of the keyboard");
  return { checked, faults };
}
