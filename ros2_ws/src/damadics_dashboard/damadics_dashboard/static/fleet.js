// Copyright 2026 DAMADICS FD maintainers
// SPDX-License-Identifier: Apache-2.0
// The tiles of the fleet: built once, changed where the server says so, found by search, class and
// area. Every text from the server is set as text.

(() => {
  const ROWS = 60; // tiles that are laid out together: whole rows at 1 to 6 columns
  const FEW = 300; // tiles of an area that are found and laid out as one
  const tiles = new Map(); // name -> {item, link, parts, told, text, at, rows, found}
  const areas = new Map(); // area -> {section, list, tiles, rows, found}
  const counts = {}; // tiles by kind
  const filter = { text: '', kind: '', area: '' };
  let words = []; // of the search
  let order = [];
  let ages = []; // s, in that order, when the server told them last
  let shares = []; // percent of the limit, where the server tells nothing else
  let agedAt = 0;

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

  // Thousands of tiles are out of sight: a tile is empty until it is first seen, and what only the
  // eye sees of it is drawn when it is seen.
  const sight = new IntersectionObserver((entries) => entries.forEach((entry) => {
    const { rows } = entry.target;
    rows.near = entry.isIntersecting;
    rows.tiles.forEach((tile) => (seen(tile) ? refresh(tile) : rest(tile)));
  }), { rootMargin: '400px' });

  const seen = (tile) => tile.found && (tile.rows?.near || tile.area?.few);

  function build(name) {
    const item = make('div', 'item', null, { role: 'listitem' });
    const link = make('a', 'tile', item);
    link.dataset.valve = name;
    return { item, link, found: true };
  }

  function fill({ link }) {
    const top = make('span', 'top', link);
    const sign = symbol('off', top);
    const head = make('span', 'who', top);
    const parts = {
      sign,
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
    return parts;
  }

  const put = (element, text) => {
    if (element.textContent !== text) element.textContent = text;
  };

  function show(name, told) {
    let tile = tiles.get(name);
    if (!tile) {
      tile = build(name);
      tiles.set(name, tile);
    }
    if (tile.told) counts[tile.told.kind] -= 1;
    counts[told.kind] = (counts[told.kind] || 0) + 1;
    tile.told = told;
    tile.text = `${told.title} ${told.tag} ${told.state} ${told.why}`.toLowerCase();
    const { link } = tile;
    if (link.dataset.kind !== told.kind) {
      link.className = `tile ${told.kind}`;
      link.dataset.kind = told.kind;
    }
    if (link.getAttribute('href') !== told.address) link.setAttribute('href', told.address);
    if (link.getAttribute('aria-label') !== told.label) link.setAttribute('aria-label', told.label);
    tile.drawn = false;
    return tile;
  }

  function draw(tile) {
    if (tile.drawn) return;
    tile.drawn = true;
    tile.parts ||= fill(tile);
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
    tile.share = undefined;
  }

  // Draw what has changed of a tile that is seen, with its residual and its age of now.
  function refresh(tile) {
    draw(tile);
    const { told, parts: p } = tile;
    const share = shares[tile.at];
    if (share >= 0 && told.kind === 'ok' && tile.share !== share) {
      tile.share = share;
      put(p.ratio, document.getElementById('tiles').dataset.ofLimit.replace('#', share));
      p.fill.style.width = `${Math.min(share / 1.5, 100).toFixed(1)}%`;
      p.fill.classList.toggle('over', share > 100);
    }
    const age = ages[tile.at];
    p.age.away = false;
    if (age === undefined) return;
    if (age === null) {
      p.age.removeAttribute('data-age');
      put(p.age, told.never);
    } else {
      p.age.dataset.age = String(age + (performance.now() - agedAt) / 1000);
      p.age.told = undefined;
    }
  }

  // A tile out of sight grows no older on the page: nobody reads it.
  function rest(tile) {
    if (tile.parts) tile.parts.age.away = true;
  }

  // Lay the tiles out by area, in the order of the server, a few rows together.
  function arrange() {
    const place = document.getElementById('tiles');
    const members = new Map();
    order.forEach((name, at) => {
      const tile = tiles.get(name);
      if (!tile) return;
      tile.at = at;
      const key = tile.told.area;
      if (!members.has(key)) members.set(key, []);
      members.get(key).push(tile);
    });
    [...areas.keys()].filter((key) => !members.has(key)).forEach((key) => {
      areas.get(key).section.remove();
      areas.delete(key);
    });
    [...members.keys()].sort().forEach((key) => {
      if (!areas.has(key)) {
        const section = make('section', 'area');
        make('h2', '', section).textContent = key;
        const list = make('div', '', section, {
          role: 'list', 'aria-label': key || place.dataset.label,
        });
        areas.set(key, { section, list, rows: [] });
      }
      const area = areas.get(key);
      area.tiles = members.get(key);
      part(area);
      place.append(area.section);
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

  function part(area) {
    for (let n = 0; n * ROWS < area.tiles.length; n += 1) {
      if (!area.rows[n]) {
        const element = make('div', 'rows tiles', area.list, { role: 'presentation' });
        area.rows[n] = { element, tiles: [], near: false };
        element.rows = area.rows[n];
      }
      const rows = area.rows[n];
      const mine = area.tiles.slice(n * ROWS, (n + 1) * ROWS);
      if (mine.length !== rows.tiles.length || mine.some((tile, k) => tile !== rows.tiles[k])) {
        rows.tiles = mine;
        rows.element.replaceChildren(...mine.map((tile) => tile.item));
        sight.unobserve(rows.element); // it tells anew what is in sight
        sight.observe(rows.element);
      }
      mine.forEach((tile) => { tile.rows = rows; tile.area = area; });
    }
    area.rows.splice(Math.ceil(area.tiles.length / ROWS)).forEach(({ element }) => {
      sight.unobserve(element);
      element.remove();
    });
    measure(area);
  }

  // The room of rows that are out of sight, so that the scroll bar tells the truth.
  function measure(area) {
    const width = document.getElementById('tiles').clientWidth;
    const columns = Math.max(1, Math.floor((width + 14) / 304));
    area.rows.forEach(({ element, tiles: mine }) => {
      const tall = `${Math.ceil(mine.length / columns) * 167 - 14}px`;
      if (element.style.getPropertyValue('--tall') !== tall) {
        element.style.setProperty('--tall', tall);
      }
    });
  }

  // Tell whether a tile is what the filter asks for.
  function sieve(tile) {
    const t = tile.told;
    const good = words.every((word) => tile.text.includes(word))
      && (!filter.kind || t.kind === filter.kind) && (!filter.area || t.area === filter.area);
    if (tile.item.hidden === good) tile.item.hidden = !good;
    tile.found = good;
  }

  // Show as much of an area as was found of it.
  function settle(area) {
    let found = 0;
    area.rows.forEach((rows) => {
      const here = rows.tiles.reduce((sum, tile) => sum + tile.found, 0);
      if (rows.element.hidden === here > 0) rows.element.hidden = !here;
      found += here;
    });
    area.found = found;
    area.few = found < area.tiles.length && found <= FEW;
    area.section.hidden = !found;
    area.section.classList.toggle('few', area.few);
    if (area.few) area.tiles.filter(seen).forEach(refresh);
  }

  function sift() {
    words = filter.text.toLowerCase().split(/\s+/).filter(Boolean);
    tiles.forEach(sieve);
    areas.forEach(settle);
    tally();
  }

  function tally() {
    let found = 0;
    areas.forEach((area) => { found += area.found; });
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

  // One message of the server: what has changed of which valve; ages and residuals of all, in
  // their order.
  function fleet(message, columns) {
    if (columns) {
      ages = columns.ages;
      shares = columns.shares;
      agedAt = performance.now();
    }
    const changed = Object.entries(message.tiles);
    const shown = changed.map(([name, told]) => show(name, told));
    if (message.order) {
      order = message.order;
      const gone = new Set(tiles.keys());
      order.forEach((name) => gone.delete(name));
      gone.forEach((name) => {
        counts[tiles.get(name).told.kind] -= 1;
        tiles.get(name).item.remove();
        tiles.delete(name);
      });
      arrange();
      sift();
    } else if (shown.length) {
      shown.forEach(sieve);
      new Set(shown.map((tile) => tile.area)).forEach(settle);
      shown.filter(seen).forEach(refresh);
      tally();
    }
    if (columns) {
      areas.forEach((area) => area.rows.forEach(({ near, tiles: mine }) => {
        if (near || area.few) mine.filter(seen).forEach(refresh);
      }));
    }
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
    window.addEventListener('resize', () => areas.forEach(measure));
    document.addEventListener('keydown', (event) => {
      if (event.key === '/' && !/INPUT|TEXTAREA|SELECT/.test(document.activeElement.tagName)) {
        event.preventDefault();
        search.focus();
      }
    });
  }

  window.damadics = Object.assign(window.damadics || {}, { fleet, filters });
})();
