/** Whether an element is in view, or soon will be. */

import { useEffect, useState, type RefObject } from "react";

/** Drawn so far ahead that scrolling shows no card without figures. */
const MARGIN = "600px 0px";

/** Tells whether the element is near the part of its list that is shown, or of the whole page. */
export function useIsNear(
  element: RefObject<HTMLElement | null>,
  isNearAtFirst: boolean,
  within: "list" | "page" = "list",
): boolean {
  const [isNear, setNear] = useState(isNearAtFirst);
  useEffect(() => {
    if (element.current === null) return;
    const observer = new IntersectionObserver(
      (changes) => setNear(changes.at(-1)?.isIntersecting ?? true),
      { root: within === "list" ? element.current.parentElement : null, rootMargin: MARGIN },
    );
    observer.observe(element.current);
    return () => observer.disconnect();
  }, [element, within]);
  return isNear;
}
