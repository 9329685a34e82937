/** react-three-fiber: `deeplight/react-three-fiber`. */
import { createElement, Fragment, type ReactElement, useEffect, useMemo, useState } from "react";
import type { Object3D, Texture } from "three";
import type { Light } from "../light.ts";
import { DeepLightEstimatedLight } from "./three.ts";

export interface EstimatedLightProps {
  /** What `estimate` gave; dark until there is one. */
  readonly light: Light | null;
  /** The camera that saw the photo, where the scene's world is not its frame. */
  readonly camera?: Object3D | undefined;
  /** Its main light throws shadows. */
  readonly castShadow?: boolean | undefined;
}

/** Lights the scene of a `<Canvas>`: its environment, and a directional light for the main light. */
export function EstimatedLight(props: EstimatedLightProps): ReactElement {
  const { light, camera, castShadow = false } = props;
  const group = useMemo(() => new DeepLightEstimatedLight(), []);
  const [environment, setEnvironment] = useState<Texture | null>(null);
  useEffect(() => {
    if (light) group.setLight(light, camera);
    else group.clearLight();
    setEnvironment(group.environment);
  }, [group, light, camera]);
  useEffect(() => () => group.dispose(), [group]);
  group.directionalLight.castShadow = castShadow;
  return createElement(
    Fragment,
    null,
    createElement("primitive", { object: group }),
    environment && createElement("primitive", { object: environment, attach: "environment" }),
  );
}
