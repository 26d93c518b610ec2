import { useEffect, useRef, useState } from "react";
import { useTranslation } from "react-i18next";
import { listVideos } from "../api/resources";
import type { Video } from "../api/types";
import { Button } from "../controls/Button";
import { Notice } from "../controls/states";
import { useResource } from "../live/use_resource";

/** How often a camera is asked about while its picture does not come. */
const ASK_MS = 3_000;

/** What a vehicle's camera sees now, once somebody asks for it; nothing for one without a camera. */
export function LivePicture({ vehicleId }: { vehicleId: number }) {
  const { t } = useTranslation();
  const videos = useResource(listVideos);
  const [isOpen, setOpen] = useState(false);
  const video = videos.value?.find((one) => one.vehicle_id === vehicleId);
  if (video === undefined) return null;
  return (
    <section className="live-picture">
      <Button icon="picture" aria-expanded={isOpen} onClick={() => setOpen(!isOpen)}>
        {t(isOpen ? "video.hide" : "video.show")}
      </Button>
      {isOpen && <Picture key={vehicleId} video={video} reload={videos.reload} />}
    </section>
  );
}

function Picture({ video, reload }: { video: Video; reload: () => void }) {
  const { t } = useTranslation();
  const image = useRef<HTMLImageElement>(null);
  const [attempt, setAttempt] = useState(0);
  const [state, setState] = useState<"waiting" | "shown" | "ended">("waiting");
  useEffect(() => {
    const element = image.current;
    // Without this the browser receives pictures that nobody sees
    return () => element?.removeAttribute("src");
  }, [attempt]);
  useEffect(() => {
    if (state === "shown") return;
    const timer = setInterval(reload, ASK_MS);
    return () => clearInterval(timer);
  }, [state, reload]);
  const name = t("video.name", { id: video.vehicle_id });
  return (
    <figure>
      {state !== "ended" && (
        <img
          key={attempt}
          ref={image}
          src={`${video.url}?attempt=${attempt}`}
          alt={name}
          hidden={state !== "shown"}
          onLoad={() => setState("shown")}
          onError={() => setState("ended")}
        />
      )}
      {state === "waiting" && (
        <p className="live-picture-empty" role="status">
          <span className="spinner" />
          <span>{video.reason === null ? t("video.waiting") : t("video.failed", { reason: video.reason })}</span>
        </p>
      )}
      {state === "ended" && (
        <Notice kind="error">
          <p>{video.reason === null ? t("video.ended") : t("video.failed", { reason: video.reason })}</p>
          <Button
            onClick={() => {
              setAttempt(attempt + 1);
              setState("waiting");
            }}
          >
            {t("action.try_again")}
          </Button>
        </Notice>
      )}
      {state === "shown" && <figcaption className="muted small">{t("video.delay")}</figcaption>}
    </figure>
  );
}
