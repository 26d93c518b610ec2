/** The steps of a plan that have a place, on the editor's map: they are dragged, and moved by the keys. */

import { useMemo, useRef } from "react";
import { useTranslation } from "react-i18next";
import type { Fault } from "../api/client";
import type { Command } from "../api/types";
import { placeOf } from "../map/features";
import type { Symbol } from "../map/FarmMap";
import { updateWaypointElement, waypointElement } from "../map/markers";
import { placeOfFault, problemsOf } from "../planning/command_forms";
import { shifted } from "../planning/ground";

interface StepActions {
  select: (index: number) => void;
  remove: (index: number) => void;
  move: (index: number, latitude: number, longitude: number, isDropped: boolean) => void;
}

export function useStepSymbols(
  commands: readonly Command[],
  open: number | null,
  /** What the edge server has found. */
  faults: readonly Fault[],
  actions: StepActions,
): Symbol[] {
  const { t } = useTranslation();
  // An element is made once and acts on the plan as it is when somebody uses it
  const latest = useRef({ commands, actions });
  latest.current = { commands, actions };
  return useMemo(
    () =>
      commands.flatMap((command, index): Symbol[] => {
        const place = placeOf(command);
        if (place === null) return [];
        const name = t("editor.step", { index: index + 1, name: t(`command.${command.command_type_id}`) });
        const texts = [
          ...faults.filter((fault) => placeOfFault(fault.path)?.index === index).map((fault) => fault.text),
          ...problemsOf(command).map(({ parameter }) => t(`parameter.${parameter.name}`)),
        ];
        return [
          {
            key: `step-${index}`,
            longitude: place[0],
            latitude: place[1],
            level: 3,
            isMovedAside: true,
            make: () =>
              waypointElement(String(index + 1), name, {
                select: () => latest.current.actions.select(index),
                remove: () => latest.current.actions.remove(index),
                move: (north_m, east_m) => {
                  const present = latest.current.commands[index];
                  const from = present === undefined ? null : placeOf(present);
                  if (from === null) return;
                  const [latitude, longitude] = shifted([from[1], from[0]], north_m, east_m);
                  latest.current.actions.move(index, latitude, longitude, true);
                },
              }),
            update: (element) => updateWaypointElement(element, name, index === open, texts),
            drag: (longitude, latitude, isDropped) =>
              latest.current.actions.move(index, latitude, longitude, isDropped),
          },
        ];
      }),
    [commands, open, faults, t],
  );
}
