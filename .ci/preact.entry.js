// What the station takes of its libraries. The module that pages load is made of this:
// npm install preact@10.29.8 @preact/signals@2.11.4 htm@3.1.1 esbuild@0.28.2
// npx esbuild preact.entry.js --bundle --format=esm --minify --legal-comments=none --banner:js="/* Preact, its signals (MIT), htm (Apache-2.0): see THIRD_PARTY.md */" --outfile=preact.min.js
import htm from "htm";
import { h } from "preact";

export { createRef, Fragment, h, render } from "preact";
export { useCallback, useEffect, useLayoutEffect, useMemo, useRef, useState } from "preact/hooks";
export { batch, computed, effect, signal, untracked, useComputed, useSignal, useSignalEffect } from "@preact/signals";
export const html = htm.bind(h);
