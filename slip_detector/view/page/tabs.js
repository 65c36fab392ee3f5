// Tabs as the ARIA Authoring Practices describe them: one tab stop, arrows choose.

// list: the element with the role tablist. onChoose(id): called when the panel of this id is shown.
export function tabs(list, onChoose = () => {}) {
  const all = [...list.querySelectorAll('[role=tab]')];
  const panelOf = (tab) => tab.getAttribute('aria-controls');
  const choose = (chosen) => {
    for (const tab of all) {
      tab.ariaSelected = String(tab === chosen);
      tab.tabIndex = tab === chosen ? 0 : -1;
      element(panelOf(tab)).hidden = tab !== chosen;
    }
    onChoose(panelOf(chosen));
  };
  list.addEventListener('click', ({target}) => {
    if (all.includes(target)) choose(target);
  });
  list.addEventListener('keydown', (event) => {
    const at = all.indexOf(event.target);
    const next = {ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: -1}[event.key];
    if (next === undefined) return;
    event.preventDefault();
    const tab = all.at(next % all.length);
    tab.focus();
    choose(tab);
  });
  choose(all[0]);
}
