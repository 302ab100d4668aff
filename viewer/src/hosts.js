// Which hosts the page may ask. Its own policy cannot know what users type, so that it has to allow all; this allows the page's own server, and the
// one that images come from if the address names one. A policy can only become stricter: another host takes a new start of the page.
import { readLink } from './link.js';

// Returns a template of URLs as an absolute one, or throws what is wrong with it.
export function absoluteTemplate(text = '') {
  if (!/{z}/.test(text) || !/{x}/.test(text) || !/{-?y}/.test(text)) throw new Error('The address needs {z}, {x} and {y} or {-y}.');
  const url = new URL(text.replace(/{s}/g, 'a'), document.baseURI);
  if (!/^https?:$/.test(url.protocol)) throw new Error('The address must begin with https://');
  return url.href.replace(/%7B/gi, '{').replace(/%7D/gi, '}');
}

// Returns whether a text is a template of URLs.
export function isTemplate(text) {
  try {
    return Boolean(absoluteTemplate(text));
  } catch {
    return false;
  }
}

const hostOf = (template) => new URL(absoluteTemplate(template)).origin;

// The template that the page has been written with.
const written = document.documentElement.dataset.images;
export const usualImages = isTemplate(written) ? absoluteTemplate(written) : null;

const images = readLink().images ?? usualImages;
const imageHost = isTemplate(images) ? hostOf(images) : '';

document.head.append(Object.assign(document.createElement('meta'), {
  httpEquiv: 'Content-Security-Policy',
  content: `connect-src 'self' blob: data: ${imageHost}`,
}));

// Returns whether the images of a template may be asked for.
export const mayAsk = (template) => [location.origin, imageHost].includes(hostOf(template));
