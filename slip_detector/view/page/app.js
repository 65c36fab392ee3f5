// The live page: puts its parts together. Texts from the robot go into textContent, never into HTML.

import {Connection} from './connection.js';

const element = (id) => document.getElementById(id);

const connection = new Connection((words) => {
  element('connection').textContent = words || 'connected';
});

connection.on('hand', ({fingers}) => {
  element('fingers').replaceChildren(...fingers.map(({name, label}) => {
    const card = document.createElement('article'), title = document.createElement('h2'), state = document.createElement('p');
    card.dataset.finger = name;
    title.textContent = label;
    card.append(title, state);
    return card;
  }));
  connection.look({fingers: fingers.map(({name}) => name)});
});

connection.onFrame(({header, arrays}) => {
  header.fingers.forEach(({name, slip, valid}, i) => {
    const state = document.querySelector(`[data-finger=${CSS.escape(name)}] p`);
    if (!state) return;
    const highest = Math.max(...arrays[`level/${i}`].filter((level) => !Number.isNaN(level)));
    state.textContent = `${slip ? 'slip' : 'no slip'}, ${valid ? 'valid' : 'not valid'}, ${highest.toFixed(3)} of the threshold`;
  });
});

connection.open();
