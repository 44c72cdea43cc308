// Lays two pictures of the page over each other: drag or arrow keys to move the border, wheel to zoom, F to flip.
(() => {
  const stage = document.querySelector('.stage');
  if (!stage) return;
  const images = [...document.querySelectorAll('figure img')];
  const [below, above] = stage.querySelectorAll('img');
  const tags = stage.querySelectorAll('.tag');
  const [left, right] = document.querySelectorAll('.controls select');
  const usable = images.filter(i => i.dataset.viewer === '1');
  for (const list of [left, right]) for (const image of usable) list.add(new Option(image.dataset.name));
  right.selectedIndex = Math.min(1, usable.length - 1);
  let zoom = 1, x = 0, y = 0;

  const show = () => {
    below.src = usable[left.selectedIndex].src;
    above.src = usable[right.selectedIndex].src;
    tags[0].textContent = left.value;
    tags[1].textContent = right.value;
  };
  const place = () => {
    const box = stage.getBoundingClientRect();
    x = Math.min(0, Math.max(box.width * (1 - zoom), x));
    y = Math.min(0, Math.max(box.height * (1 - zoom), y));
    for (const image of [below, above]) image.style.transform = `translate(${x}px, ${y}px) scale(${zoom})`;
    stage.classList.toggle('zoomed', zoom > 1);
  };
  let border = 0.5;
  const set_border = share => {
    border = Math.min(1, Math.max(0, share));
    stage.style.setProperty('--at', `${border * 100}%`);
    stage.setAttribute('aria-valuenow', Math.round(border * 100));
  };
  const divide = event => {
    const box = stage.getBoundingClientRect();
    set_border((event.clientX - box.left) / box.width);
  };
  let drag = null;
  // Browsers would drag the picture itself, and take the pointer away.
  stage.addEventListener('dragstart', event => event.preventDefault());
  stage.addEventListener('pointerdown', event => {
    if (event.button !== 0) return;
    stage.setPointerCapture(event.pointerId);
    drag = event.shiftKey ? [event.clientX - x, event.clientY - y] : [];
    if (!drag.length) divide(event);
  });
  stage.addEventListener('pointermove', event => {
    if (!drag) return;
    if (drag.length) { x = event.clientX - drag[0]; y = event.clientY - drag[1]; place(); } else divide(event);
  });
  for (const end of ['pointerup', 'pointercancel']) stage.addEventListener(end, () => { drag = null; });
  stage.addEventListener('keydown', event => {
    const step = {ArrowLeft: -0.01, ArrowRight: 0.01}[event.key];
    if (!step) return;
    event.preventDefault();
    set_border(border + step * (event.shiftKey ? 10 : 1));
  });
  stage.addEventListener('wheel', event => {
    event.preventDefault();
    const box = stage.getBoundingClientRect();
    const before = zoom;
    zoom = Math.min(32, Math.max(1, zoom * (event.deltaY < 0 ? 1.25 : 0.8)));
    x += (event.clientX - box.left - x) * (1 - zoom / before);
    y += (event.clientY - box.top - y) * (1 - zoom / before);
    place();
  }, {passive: false});
  const flip = () => { [left.selectedIndex, right.selectedIndex] = [right.selectedIndex, left.selectedIndex]; show(); };
  document.querySelector('button.flip').addEventListener('click', flip);
  document.querySelector('button.reset').addEventListener('click', () => {
    zoom = 1; x = y = 0; place(); set_border(0.5);
  });
  document.addEventListener('keydown', event => {
    if ((event.key === 'f' || event.key === 'F') && event.target.tagName !== 'SELECT') flip();
  });
  left.addEventListener('change', show);
  right.addEventListener('change', show);
  for (const image of images) image.addEventListener('click', () => {
    const index = usable.indexOf(image);
    if (index < 0) return;
    right.selectedIndex = index;
    show();
    stage.scrollIntoView({behavior: 'smooth', block: 'center'});
  });
  show();
})();
