// Copyright 2026 DAMADICS FD maintainers
// SPDX-License-Identifier: Apache-2.0
// Feeds the charts of a page: keeps their points, adds what the server sends, follows the theme,
// shares zoom and cursor among the charts of a group. The charts themselves are Apache ECharts.

(() => {
  const UNSEEN = 3000; // ms between two drawings of a plot that nobody sees yet
  const DATED = 1e8; // s; smaller times count from the start of a simulation
  const STEPS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800,
    3600, 7200, 10800, 21600, 43200, 86400, 172800, 604800, 1209600, 2592000, 7776000, 31536000];
  const charts = new Map(); // element id -> {spec, data, range, areas, chart, frozen}
  const css = (name) => getComputedStyle(document.body).getPropertyValue(name).trim();
  const chartOf = (id) => {
    const element = typeof getElement === 'function' ? getElement(id) : undefined;
    return element && element.chart && !element.chart.isDisposed() ? element.chart : undefined;
  };
  const two = (n) => String(n).padStart(2, '0');
  const comma = (text) => (document.documentElement.lang === 'de' ? text.replace('.', ',') : text);

  function zone(seconds) {
    const minutes = -new Date(seconds * 1000).getTimezoneOffset();
    if (!minutes) return 'UTC';
    const size = Math.abs(minutes);
    return `UTC${minutes > 0 ? '+' : '−'}${two(Math.floor(size / 60))}:${two(size % 60)}`;
  }

  const narrow = (chart) => chart.getWidth() < 420;

  function clock(seconds, span, full, brief) {
    if (seconds < DATED) return `${comma(String(+seconds.toFixed(2)))} s`;
    const d = new Date(seconds * 1000);
    const day = `${d.getFullYear()}-${two(d.getMonth() + 1)}-${two(d.getDate())}`;
    const time = `${two(d.getHours())}:${two(d.getMinutes())}`;
    const second = `${time}:${two(d.getSeconds())}`;
    if (full) {
      const parts = span < 10 ? `.${String(d.getMilliseconds()).padStart(3, '0')}` : '';
      return `${day} ${second}${parts} ${zone(seconds)}`;
    }
    if (brief && span > 200 * 86400) return day.slice(0, 7);
    if (span > 20 * 86400) return brief ? day.slice(5) : day;
    if (span > 86400) return `${day.slice(5)} ${time}`;
    return span > 7200 ? time : second;
  }

  const short = (value) => comma(Math.abs(value) >= 1e-3 && Math.abs(value) < 1e6 || value === 0
    ? `${+value.toPrecision(4)}` : value.toExponential(1));

  // Labels at round times, and no more of them than there is room for.
  function step(span, chart) {
    const width = span > 86400 && !(narrow(chart) && span > 20 * 86400) ? 96 : 78;
    const room = Math.max(Math.floor((chart.getWidth() - 70) / width), 2);
    return STEPS.find((s) => span / s <= room) || STEPS[STEPS.length - 1];
  }

  function shown(entry) {
    const [from, to] = entry.range || [0, 60];
    const width = to - from;
    const zoom = entry.zoom || [0, 100];
    return [from + width * zoom[0] / 100, from + width * zoom[1] / 100];
  }

  function axis(entry, chart) {
    const [from, to] = entry.range;
    const [a, b] = shown(entry);
    const width = step(b - a, chart);
    // round in local time: a day begins at midnight here
    const shift = from < DATED ? 0 : -60 * new Date(from * 1000).getTimezoneOffset();
    const ticks = [];
    for (let t = Math.ceil((a + shift) / width) * width - shift; t <= b; t += width) ticks.push(t);
    return {
      min: from, max: to,
      axisTick: { customValues: ticks }, axisLabel: { customValues: ticks },
      name: from < DATED ? '' : zone(from),
    };
  }

  function style(id) {
    const chart = chartOf(id);
    const entry = charts.get(id);
    if (!chart || !entry) return;
    const { spec } = entry;
    const [ink, muted, line, card] = ['--ink', '--muted', '--line', '--card'].map(css);
    const look = {
      axisLine: { onZero: false, lineStyle: { color: line } },
      axisTick: { lineStyle: { color: line } },
      splitLine: { lineStyle: { color: line, opacity: 0.6 } },
      axisLabel: { color: muted },
      nameTextStyle: { color: muted },
    };
    const label = (format) => ({ ...look.axisLabel, formatter: format });
    const span = () => { const [a, b] = shown(entry); return b - a; };
    const ordinates = chart.getOption().yAxis.map((_, n) => ({
      ...look, axisLabel: label(short), ...(n ? { splitLine: { show: false } } : {}),
    }));
    chart.setOption({
      textStyle: { color: ink, fontFamily: css('--font') },
      legend: { textStyle: { color: muted }, inactiveColor: line },
      tooltip: {
        backgroundColor: card, borderColor: line, textStyle: { color: ink },
        valueFormatter: (v) => (Number.isFinite(v) ? short(v) : '–'),
      },
      axisPointer: { label: { formatter: (p) => (p.axisDimension === 'x' && !spec.xy
        ? clock(p.value, span(), true) : short(p.value)) } },
      xAxis: { ...look,
        axisLabel: { ...label(spec.xy ? short : (v) => clock(v, span(), false, narrow(chart))),
          hideOverlap: true } },
      yAxis: ordinates,
      series: spec.colors.map((name) => ({
        lineStyle: { color: css(name) }, itemStyle: { color: css(name) },
        markArea: { itemStyle: { color: css('--alarm-area') } },
        markLine: { lineStyle: { color: css('--rho') }, label: { color: muted } },
      })),
    });
  }

  // Numbers in a row are taken as they are; pairs would be copied and looked into one by one.
  function flat(points) {
    const numbers = new Float64Array(2 * points.length);
    points.forEach(([x, y], n) => { numbers[2 * n] = x; numbers[2 * n + 1] = y ?? NaN; });
    return numbers;
  }

  function draw(id) {
    const chart = chartOf(id);
    const entry = charts.get(id);
    if (!chart || !entry) return;
    if (entry.chart !== chart) {
      entry.chart = chart;
      chart.getZr().setSleepAfterStill(1); // what stands still asks for no more frames
      style(id);
      if (entry.spec.group) {
        chart.group = entry.spec.group;
        window.damadics.echarts = chart.constructor;
        connect(entry.spec.group);
      }
      chart.on('datazoom', () => zoomed(id));
    }
    if (!entry.watched) watch(id, entry);
    const empty = entry.data.every((points) => !points.length);
    const place = document.querySelector(`[data-plot="${id}"]`);
    if (place && entry.told) { // until then it says that it is loading
      const note = entry.absent ? place.dataset.absent : place.dataset.empty;
      if (place.hidden === empty) place.hidden = !empty;
      if (place.textContent !== note) place.textContent = note;
    }
    if (!due(entry, empty)) { entry.late = true; return; }
    entry.late = false;
    entry.filled = !empty;
    entry.drawn = performance.now();
    const option = { series: entry.data.map((points) => ({ data: flat(points) })) };
    if (entry.range && !entry.spec.xy) option.xAxis = axis(entry, chart);
    const marked = JSON.stringify(entry.areas || []);
    if (marked !== entry.marked) option.series[0].markArea = { data: entry.areas };
    entry.marked = marked;
    chart.setOption(option);
    // it has been drawn: no frame is needed until the next one (clouds are drawn in parts)
    if (!entry.spec.xy) chart.getZr().animation.stop();
  }

  // What is in sight is drawn at once, what is within a screen of it now and then, what is
  // further away when it comes near; so nobody scrolls to an empty plot.
  const due = (entry, empty) => !document.hidden && (entry.seen !== false || (!entry.filled && !empty)
    || (entry.near !== false && performance.now() - entry.drawn > UNSEEN));

  function watch(id, entry) {
    entry.watched = true;
    const observe = (name, rootMargin) => new IntersectionObserver((places) => {
      entry[name] = places[places.length - 1].isIntersecting;
      if (entry[name] && entry.late) draw(id);
    }, { rootMargin }).observe(entry.chart.getDom());
    observe('seen', '50px');
    observe('near', '100% 0px');
  }

  // The charts of a group show the same time: what one is zoomed to or points at, all are.
  function connect(group) {
    const members = () => [...charts.values()].filter((e) => e.spec.group === group && e.chart
      && !e.chart.isDisposed());
    members().forEach((entry) => {
      if (entry.joined === entry.chart) return;
      entry.joined = entry.chart;
      entry.chart.on('updateAxisPointer', (event) => {
        const at = event.axesInfo && event.axesInfo.find((info) => info.axisDim === 'x');
        if (!at || sharing) return;
        sharing = true;
        members().filter((other) => other !== entry).forEach((other) => {
          const x = other.chart.convertToPixel({ xAxisIndex: 0 }, at.value);
          const inside = Number.isFinite(x);
          other.chart.dispatchAction(inside
            ? { type: 'updateAxisPointer', currTrigger: 'mousemove', x, y: 60 }
            : { type: 'hideTip' });
        });
        sharing = false;
      });
    });
  }
  let sharing = false;

  function zoomed(id) {
    const entry = charts.get(id);
    const [{ start, end }] = entry.chart.getOption().dataZoom;
    const zoom = [start, end];
    const whole = start <= 0 && end >= 100;
    charts.forEach((other, key) => {
      if (other.spec.group !== entry.spec.group || other.spec.xy || !other.chart) return;
      const before = other.zoom || [0, 100];
      other.zoom = zoom;
      other.frozen = !whole;
      if (key !== id && (before[0] !== start || before[1] !== end)) {
        other.chart.dispatchAction({ type: 'dataZoom', start, end });
      }
      other.chart.setOption({ xAxis: axis(other, other.chart) }, { lazyUpdate: true });
    });
    document.body.classList.toggle('zoomed', !whole);
  }

  function whole() {
    charts.forEach((entry) => {
      if (entry.chart && !entry.spec.xy && entry.zoom) {
        entry.chart.dispatchAction({ type: 'dataZoom', start: 0, end: 100 });
      }
    });
  }

  // One message of the server: per chart {from, series, range, areas, all, absent}. Points from `from` on
  // are replaced by the new ones, points before the range are dropped. A chart that a person has
  // zoomed into stands still; what comes meanwhile is kept.
  function push(message) {
    for (const [key, part] of Object.entries(message)) {
      const id = Number(key);
      const entry = charts.get(id);
      if (!entry) continue;
      entry.told = true;
      if (part.range && (!entry.frozen || part.all)) entry.range = part.range;
      if (part.areas) entry.areas = part.areas;
      entry.absent = part.absent;
      entry.data = entry.data.map((old, n) => {
        const fresh = part.series[n];
        if (!fresh) return old;
        if (part.all) return fresh;
        const from = part.from[n];
        const start = entry.range[0];
        let end = old.length;
        while (end > 0 && old[end - 1][0] >= from) end -= 1;
        let begin = 0;
        while (begin + 1 < end && old[begin + 1][0] < start) begin += 1;
        return old.slice(begin, end).concat(fresh);
      });
      draw(id);
    }
    window.damadics.messages += 1;
  }

  function register(id, spec) {
    charts.set(id, { spec, data: spec.colors.map(() => []), marked: '[]' });
    const wait = () => (chartOf(id) ? draw(id) : setTimeout(wait, 50));
    wait();
  }

  // The chart's numbers as a file, for a spreadsheet.
  function save(id, name) {
    const entry = charts.get(id);
    const names = entry.chart.getOption().series.map((s) => s.name);
    const lines = ['curve,time_s,value'];
    entry.data.forEach((points, n) => points.forEach(([t, v]) => {
      if (v !== null) lines.push(`"${names[n].replace(/"/g, '""')}",${t},${v}`);
    }));
    const link = document.createElement('a');
    link.href = URL.createObjectURL(new Blob([`${lines.join('\n')}\n`], { type: 'text/csv' }));
    link.download = `${name}.csv`;
    link.click();
    URL.revokeObjectURL(link.href);
  }

  window.damadics = Object.assign(window.damadics || {}, {
    register, push, whole, save, messages: 0, points: (id) => charts.get(id).data,
    shown: (id) => shown(charts.get(id)), clock,
  });
  // Only another theme is a reason: the class is also set again without a change, every second.
  let theme = '';
  const restyle = () => {
    const present = css('--ink') + css('--card');
    if (present === theme) return;
    theme = present;
    charts.forEach((_, id) => { style(id); draw(id); });
  };
  const start = () => {
    theme = css('--ink') + css('--card');
    new MutationObserver(() => setTimeout(restyle, 30))
      .observe(document.body, { attributes: true, attributeFilter: ['class'] });
    document.addEventListener('visibilitychange', () => charts.forEach((entry, id) => {
      if (entry.late) draw(id);
    }));
  };
  if (document.body) start(); else document.addEventListener('DOMContentLoaded', start);
})();
