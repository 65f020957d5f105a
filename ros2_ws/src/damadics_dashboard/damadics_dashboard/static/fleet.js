// Copyright 2026 DAMADICS FD maintainers
// SPDX-License-Identifier: Apache-2.0
// The tiles of the fleet: built once, changed where the server says so, found by search, class and
// area. Every text from the server is set as text.

(() => {
  const tiles = new Map(); // name -> {element, parts, told}
  const areas = new Map(); // area -> {section, list}
  const filter = { text: '', kind: '', area: '' };
  let order = [];

  const make = (tag, style, parent, attributes = {}) => {
    const element = document.createElement(tag);
    if (style) element.className = style;
    Object.entries(attributes).forEach(([key, value]) => element.setAttribute(key, value));
    if (parent) parent.append(element);
    return element;
  };

  function symbol(kind, parent) {
    const space = 'http://www.w3.org/2000/svg';
    const place = make('span', `ne ${kind}`, parent, { 'aria-hidden': 'true' });
    const svg = document.createElementNS(space, 'svg');
    svg.setAttribute('viewBox', '0 0 28 28');
    const use = document.createElementNS(space, 'use');
    use.setAttribute('href', `#ne-${kind}`);
    svg.append(use);
    place.append(svg);
    return { place, use };
  }

  function build(name) {
    const item = make('div', 'item', null, { role: 'listitem' });
    const link = make('a', 'tile', item);
    const top = make('span', 'top', link);
    const sign = symbol('off', top);
    const head = make('span', 'who', top);
    const parts = {
      item, link, sign,
      title: make('span', 'name', head),
      tag: make('span', 'sub', head),
      state: make('b', '', make('span', 'state', head)),
    };
    parts.badge = make('span', 'tag', parts.state.parentElement);
    const bar = make('span', 'bar-of-limit', link, { 'aria-hidden': 'true' });
    parts.fill = make('i', '', bar);
    make('s', '', bar);
    parts.why = make('span', 'why', link);
    const facts = make('span', 'facts', link);
    parts.ratio = make('span', '', facts);
    const fresh = make('span', '', facts);
    parts.fresh = make('span', '', fresh);
    fresh.append(' ');
    parts.age = make('b', '', fresh);
    item.addEventListener('contentvisibilityautostatechange', (event) => {
      parts.age.away = event.skipped;
      const tile = tiles.get(name);
      if (tile && !event.skipped) { draw(tile); tell(tile); }
    });
    link.dataset.valve = name;
    return parts;
  }

  const put = (element, text) => {
    if (element.textContent !== text) element.textContent = text;
  };

  // Thousands of tiles are out of sight: what only the eye sees of them is drawn when it is seen.
  function show(name, told) {
    let tile = tiles.get(name);
    if (!tile) {
      tile = { parts: build(name) };
      tiles.set(name, tile);
    }
    tile.told = told;
    tile.text = `${told.title} ${told.tag} ${told.state} ${told.why}`.toLowerCase();
    const { link } = tile.parts;
    if (link.dataset.kind !== told.kind) {
      link.className = `tile ${told.kind}`;
      link.dataset.kind = told.kind;
    }
    if (link.getAttribute('href') !== told.address) link.setAttribute('href', told.address);
    if (link.getAttribute('aria-label') !== told.label) link.setAttribute('aria-label', told.label);
    tile.drawn = false;
    if (!tile.parts.age.away) draw(tile);
    place(name, tile);
  }

  function draw(tile) {
    if (tile.drawn) return;
    tile.drawn = true;
    const { told, parts: p } = tile;
    p.sign.place.className = `ne ${told.kind}`;
    p.sign.use.setAttribute('href', `#ne-${told.kind}`);
    put(p.title, told.title);
    put(p.tag, told.tag);
    put(p.state, told.state);
    put(p.badge, told.badge);
    p.badge.className = `tag ${told.hot ? 'hot' : 'done'}`;
    p.badge.hidden = !told.badge;
    put(p.why, told.why);
    put(p.ratio, told.ratio);
    put(p.fresh, told.fresh);
    const share = told.progress >= 0 ? told.progress : Math.min(told.share / 1.5, 1);
    p.fill.style.width = `${(100 * share).toFixed(1)}%`;
    p.fill.parentElement.classList.toggle('progress', told.progress >= 0);
    p.fill.classList.toggle('over', told.progress < 0 && told.share > 1);
  }

  function tell(tile) {
    if (tile.age === undefined) return;
    const { age } = tile.parts;
    if (tile.age === null) put(age, tile.told.never);
    else {
      age.dataset.age = String(tile.age + (performance.now() - tile.agedAt) / 1000);
      age.told = undefined;
    }
  }

  function place(name, tile) {
    const area = tile.told.area;
    if (!areas.has(area)) {
      const section = make('section', 'area', document.getElementById('tiles'));
      make('h2', '', section).textContent = area;
      areas.set(area, { section, list: make('div', 'tiles', section, {
        role: 'list', 'aria-label': area || document.getElementById('tiles').dataset.label,
      }) });
    }
    const { list } = areas.get(area);
    if (tile.parts.item.parentElement !== list) list.append(tile.parts.item);
  }

  function arrange() {
    [...areas.keys()].sort().forEach((key) => {
      document.getElementById('tiles').append(areas.get(key).section);
    });
    order.forEach((name) => {
      const tile = tiles.get(name);
      if (tile) areas.get(tile.told.area).list.append(tile.parts.item);
    });
    document.body.classList.toggle('grouped', areas.size > 1);
    const select = document.getElementById('area');
    if (select) {
      const all = select.options[0];
      select.replaceChildren(all, ...[...areas.keys()].sort().map((key) => {
        const option = make('option');
        option.value = key;
        option.textContent = key || '–';
        return option;
      }));
      select.value = filter.area;
      select.hidden = areas.size < 2;
    }
  }

  function sift() {
    const counts = {};
    const words = filter.text.toLowerCase().split(/\s+/).filter(Boolean);
    let found = 0;
    const full = new Map();
    tiles.forEach((tile) => {
      const t = tile.told;
      counts[t.kind] = (counts[t.kind] || 0) + 1;
      const good = words.every((word) => tile.text.includes(word))
        && (!filter.kind || t.kind === filter.kind) && (!filter.area || t.area === filter.area);
      if (tile.parts.item.hidden === good) tile.parts.item.hidden = !good;
      if (good) { found += 1; full.set(t.area, true); }
    });
    areas.forEach(({ section }, key) => { section.hidden = !full.has(key); });
    document.querySelectorAll('.count').forEach((button) => {
      const { kind } = button.dataset;
      put(button.querySelector('b'), String(counts[kind] || 0));
      button.classList.toggle('none', !counts[kind]);
      button.setAttribute('aria-pressed', String(filter.kind === kind));
    });
    const none = document.getElementById('none-found');
    if (none) none.hidden = found > 0 || tiles.size === 0;
    const nothing = document.getElementById('no-valve');
    if (nothing) nothing.hidden = tiles.size > 0;
    const loading = document.getElementById('loading');
    if (loading) loading.remove();
  }

  // One message of the server: what has changed of which valve; ages of all, in their order.
  function fleet(message) {
    Object.entries(message.tiles).forEach(([name, told]) => show(name, told));
    if (message.order) {
      order = message.order;
      const gone = new Set(tiles.keys());
      order.forEach((name) => gone.delete(name));
      gone.forEach((name) => { tiles.get(name).parts.item.remove(); tiles.delete(name); });
      arrange();
    }
    message.ages.forEach((age, n) => {
      const tile = tiles.get(order[n]);
      if (!tile) return;
      tile.age = age;
      tile.agedAt = performance.now();
      if (!tile.parts.age.away) tell(tile);
    });
    if (message.order || Object.keys(message.tiles).length) sift();
    window.damadics.fleets = (window.damadics.fleets || 0) + 1;
  }

  function remember() {
    const query = new URLSearchParams();
    Object.entries(filter).forEach(([key, value]) => { if (value) query.set(key, value); });
    const text = query.toString();
    history.replaceState(null, '', text ? `?${text}` : location.pathname);
  }

  function filters() {
    const asked = new URLSearchParams(location.search);
    Object.keys(filter).forEach((key) => { filter[key] = asked.get(key) || ''; });
    const search = document.getElementById('search');
    search.value = filter.text;
    search.addEventListener('input', () => { filter.text = search.value; sift(); remember(); });
    const select = document.getElementById('area');
    select.addEventListener('change', () => { filter.area = select.value; sift(); remember(); });
    document.querySelectorAll('.count').forEach((button) => button.addEventListener('click', () => {
      filter.kind = filter.kind === button.dataset.kind ? '' : button.dataset.kind;
      sift();
      remember();
    }));
    document.addEventListener('keydown', (event) => {
      if (event.key === '/' && !/INPUT|TEXTAREA|SELECT/.test(document.activeElement.tagName)) {
        event.preventDefault();
        search.focus();
      }
    });
  }

  window.damadics = Object.assign(window.damadics || {}, { fleet, filters });
})();
