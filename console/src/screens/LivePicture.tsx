import { useEffect, useRef, useState } from "react";
import { useTranslation } from "react-i18next";
import { listVideos } from "../api/resources";
import type { Video } from "../api/types";
import { Button } from "../controls/Button";
import { Notice } from "../controls/states";
import { useIsConnected } from "../live/use_live";
import { useResource } from "../live/use_resource";

/** How often a camera is asked about, and a picture that has ended is asked for again. */
const ASK_MS = 3_000;
/** What is known of a camera is so old at most, and a camera may begin again by itself. */
const STOPPED_MS = 2 * ASK_MS + 1_000;

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
  const again = () => {
    setAttempt((count) => count + 1);
    setState("waiting");
  };
  useEffect(() => {
    const timer = setInterval(reload, ASK_MS);
    return () => clearInterval(timer);
  }, [reload]);
  // An image does not show that its last picture stays: the edge server says so, or was away itself
  const isConnected = useIsConnected();
  const hasStopped = video.state !== "showing" && video.state !== "connecting";
  useEffect(() => {
    if (state === "shown" && !isConnected) setState("ended");
    if (state !== "shown" || !hasStopped) return;
    const timer = setTimeout(() => setState("ended"), STOPPED_MS);
    return () => clearTimeout(timer);
  }, [hasStopped, isConnected, state]);
  useEffect(() => {
    if (state !== "ended" || !isConnected) return;
    const timer = setTimeout(again, ASK_MS);
    return () => clearTimeout(timer);
  }, [state, isConnected, attempt]);
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
          <Button onClick={again}>{t("action.try_again")}</Button>
        </Notice>
      )}
      {state === "shown" && <figcaption className="muted small">{t("video.delay")}</figcaption>}
    </figure>
  );
}
