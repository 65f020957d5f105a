// Copyright 2026 DAMADICS FD maintainers
// SPDX-License-Identifier: Apache-2.0
// What every page watches by itself: whether its server still speaks, and how old its values are.
// A page that only the server can turn grey stays green when the server is gone.

(() => {
  const LOST = 1600; // ms without a word of the server
  let heard = performance.now();
  let ros = true;
  let title = '';
  const words = {};
  const state = () => (performance.now() - heard > LOST ? 'lost' : (ros ? 'good' : 'off'));

  function duration(seconds) {
    if (seconds < 9.95) {
      const number = seconds.toFixed(1);
      return `${document.documentElement.lang === 'de' ? number.replace('.', ',') : number} s`;
    }
    if (seconds < 59.5) return `${Math.round(seconds)} s`;
    const s = Math.round(seconds);
    if (s < 3600) return `${Math.floor(s / 60)} min ${s % 60} s`;
    const m = Math.round(seconds / 60);
    return `${Math.floor(m / 60)} h ${m % 60} min`;
  }

  // An age that the server told is counted on here from the moment it came.
  function tick() {
    const now = performance.now();
    const present = state();
    const { body } = document;
    if (!body) return;
    if (body.dataset.link !== present) {
      body.dataset.link = present;
      if (present === 'lost') say(words.lost);
    }
    const place = document.getElementById('link'); // it may come later than the first loss
    const word = words[present];
    if (place && word && place.textContent !== word) place.textContent = word;
    // what the framework names in its own language, or not at all
    const root = document.documentElement;
    if (words.language && root.lang !== words.language) root.lang = words.language;
    document.querySelectorAll('.q-uploader :is(a, input, button):not([aria-label])')
      .forEach((element) => {
        if (!element.querySelector('input')) {
          element.setAttribute('aria-label', words.recording_to_replay);
        } else if (element.hasAttribute('role')) { // the input inside is what takes the keyboard
          element.removeAttribute('role');
          element.removeAttribute('tabindex');
        }
      });
    // an alarm that nobody has seen blinks; an endless animation would draw 60 times a second
    const lit = Math.floor(now / 800) % 2 && document.querySelector('.alarm.fresh');
    if (Boolean(lit) !== ('lit' in body.dataset)) body.toggleAttribute('data-lit');
    const bare = document.title.replace(/^\([^)]*\) /, '');
    if (!title || bare !== title) title = bare;
    const wanted = present === 'good' ? title : `(${words.short || '!'}) ${title}`;
    if (document.title !== wanted) document.title = wanted;
    document.querySelectorAll('[data-age]').forEach((element) => {
      if (element.away) return; // a tile out of sight: nobody reads it
      if (element.told !== element.dataset.age) {
        element.told = element.dataset.age;
        element.toldAt = now;
      }
      const old = Number(element.dataset.age) + (now - element.toldAt) / 1000;
      const text = old < 1 ? '< 1 s' : duration(old); // what stands still costs no frame
      if (element.textContent !== text) element.textContent = text;
    });
  }

  // The server tells an age anew: of the one valve that the page shows.
  function age(seconds) {
    document.querySelectorAll('.aging').forEach((element) => {
      if (seconds === null) return;
      element.dataset.age = String(seconds);
      element.told = undefined;
    });
    tick();
  }

  function beat(alive) {
    heard = performance.now();
    ros = alive;
    tick();
  }

  function say(text) {
    const region = document.getElementById('announcer');
    if (region) region.textContent = text;
  }

  // Sound and notification of a new alarm, each only where the person has asked for it.
  function alarm(text, quiet) {
    if (!quiet) say(text);
    if (localStorage.getItem('damadics.alert') !== 'on' || quiet) return;
    try {
      const context = new AudioContext();
      [0, 0.35].forEach((after) => {
        const tone = context.createOscillator();
        const gain = context.createGain();
        tone.frequency.value = 660;
        gain.gain.value = 0.15;
        tone.connect(gain).connect(context.destination);
        tone.start(context.currentTime + after);
        tone.stop(context.currentTime + after + 0.2);
      });
    } catch (problem) { console.warn('no sound:', problem); }
    if ('Notification' in window && Notification.permission === 'granted') {
      new Notification('DAMADICS FD', { body: text, tag: text });
    }
  }

  async function alerts() {
    const on = localStorage.getItem('damadics.alert') !== 'on';
    localStorage.setItem('damadics.alert', on ? 'on' : 'off');
    if (on && 'Notification' in window && Notification.permission === 'default') {
      await Notification.requestPermission();
    }
    shown();
    return on;
  }

  function shown() {
    document.body.dataset.alert = localStorage.getItem('damadics.alert') === 'on' ? 'on' : 'off';
  }

  function begin(told) {
    Object.assign(words, told);
    heard = performance.now();
    if (document.body) delete document.body.dataset.link;
    shown();
    tick();
  }

  window.damadics = Object.assign(window.damadics || {}, {
    beat, age, say, alarm, alerts, begin, duration, state,
  });
  setInterval(tick, 200);
  document.addEventListener('visibilitychange', tick);
})();

// The address of a page tells what it shows, so that it can be sent to somebody.
window.damadics.remember = (name, value) => {
  const query = new URLSearchParams(location.search);
  query.set(name, value);
  history.replaceState(null, '', `?${query}`);
};
