// Dragging in a drawing whose units are metres.

/** Handlers of something that is dragged: `onMove` hears how far it is from where it was taken, and where the pointer is. */
export function dragging(onMove: (by: readonly [number, number], to: readonly [number, number]) => void, onEnd: () => void, onBegin = () => {}) {
  return {
    onPointerDown: (event: PointerEvent) => {
      const element = event.currentTarget;
      if (!(element instanceof SVGElement) || event.button !== 0) return;
      event.preventDefault();
      element.focus();
      onBegin();
      // Taken once: a drawing that changes its extent under the pointer would slip away from it.
      const matrix = element.ownerSVGElement?.getScreenCTM()?.inverse() ?? new DOMMatrix();
      const at = ({ clientX, clientY }: PointerEvent) => new DOMPoint(clientX, clientY).matrixTransform(matrix);
      const begun = at(event);
      const place = (moved: PointerEvent) => {
        const { x, y } = at(moved);
        onMove([x - begun.x, y - begun.y], [x, y]);
      };
      const end = () => {
        element.removeEventListener("pointermove", place);
        element.removeEventListener("pointerup", end);
        element.removeEventListener("pointercancel", end);
        onEnd();
      };
      element.setPointerCapture(event.pointerId);
      element.addEventListener("pointermove", place);
      element.addEventListener("pointerup", end);
      element.addEventListener("pointercancel", end);
    },
  };
}

/** What an arrow key moves by, right and up, metres; ten times as far with Shift. */
export function arrow(event: { key: string; shiftKey: boolean; preventDefault: () => void }): readonly [number, number] | null {
  const step = event.shiftKey ? 0.1 : 0.01;
  const moves: Record<string, readonly [number, number]> = {
    ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step],
  };
  const move = moves[event.key];
  if (!move) return null;
  event.preventDefault();
  return move;
}
